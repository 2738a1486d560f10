import { Autocomplete, MultiSelect, NumberInput, SimpleGrid, Switch, TagsInput, TextInput } from "@mantine/core";
import type { Known } from "./completion";
import { withField, type Fault } from "./spec";

interface Filling {
  text: string;
  value: Readonly<Record<string, unknown>>;
  onText: (text: string) => void;
  faults: readonly Fault[];
  known: Known;
}

function texts(value: unknown): string[] {
  return Array.isArray(value) ? value.map(String) : [];
}

function inner(value: unknown, key: string): unknown {
  return typeof value === "object" && value !== null ? (value as Record<string, unknown>)[key] : undefined;
}

function amount(value: unknown): number | "" {
  return typeof value === "number" ? value : "";
}

/** The same sweep as fields; what has no field here stays as the YAML says. */
export function Form({ text, value, onText, faults, known }: Filling) {
  const set = (keys: readonly string[], to: unknown): void => {
    onText(withField(text, keys, to));
  };
  const fault = (field: string): string | undefined => {
    const found = faults.find((one) => one.message.startsWith(field));
    if (found === undefined) return undefined;
    return found.choices.length > 0 ? `${found.message}: choose from ${found.choices.join(", ")}` : found.message;
  };
  const choices = (field: string): string[] => [
    ...new Set([...(known[field] ?? []), ...(faults.find((one) => one.message.startsWith(field))?.choices ?? [])]),
  ];
  const plain = (field: string): string => (typeof value[field] === "string" ? value[field] : "");
  const number = (keys: readonly [string, string?], label: string, description: string) => {
    const [first, second] = keys;
    const found = second === undefined ? value[first] : inner(value[first], second);
    const path = second === undefined ? [first] : [first, second];
    return (
      <NumberInput
        label={label}
        description={description}
        value={amount(found)}
        min={0}
        error={fault(path.join("."))}
        onChange={(to) => {
          set(path, to === "" ? undefined : Number(to));
        }}
      />
    );
  };
  return (
    <SimpleGrid cols={{ base: 1, sm: 2 }}>
      <TextInput
        label="Name"
        value={plain("name")}
        placeholder="sweep"
        error={fault("name")}
        onChange={(event) => {
          set(["name"], event.currentTarget.value || undefined);
        }}
      />
      {number(["samples"], "Samples", "Jobs of each model on each task: seeds 0, 1, …")}
      {number(
        ["worlds"],
        "Varied worlds",
        "Each machine is scored in so many, unknown to its model; 0: in the exact one alone",
      )}
      <MultiSelect
        label="Tasks"
        data={[...new Set([...choices("tasks"), ...texts(value.tasks)])]}
        value={texts(value.tasks)}
        searchable
        error={fault("tasks")}
        onChange={(to) => {
          set(["tasks"], to);
        }}
      />
      <TagsInput
        label="Models"
        data={choices("models")}
        value={texts(value.models)}
        error={fault("models")}
        onChange={(to) => {
          set(["models"], to);
        }}
      />
      {(["workflow", "simulator", "prompts"] as const).map((field) => (
        <Autocomplete
          key={field}
          label={field.charAt(0).toUpperCase() + field.slice(1)}
          data={choices(field)}
          value={plain(field)}
          placeholder={known[`${field} default`]?.[0]}
          error={fault(field)}
          onChange={(to) => {
            set([field], to || undefined);
          }}
        />
      ))}
      {number(["budget", "max_cost_usd"], "Budget, dollars", "Nothing new starts when it is used up")}
      <Switch
        label="Tell models the data of modules and world"
        checked={value.data_sheets !== false}
        mt="md"
        onChange={(event) => {
          set(["data_sheets"], event.currentTarget.checked ? undefined : false);
        }}
      />
      <Switch
        label="Show models an example construction"
        checked={value.one_shot === true}
        mt="md"
        onChange={(event) => {
          set(["one_shot"], event.currentTarget.checked ? true : undefined);
        }}
      />
    </SimpleGrid>
  );
}
