import { Button, Fieldset, Group, NumberInput, Select, Stack, Text, TextInput } from "@mantine/core";
import { useState } from "react";
import { words } from "../../format";
import { argumentsOf, choicesOf, firstValue, isRequired, parametersOf, type Field, type Parameter } from "./arguments";
import type { Hand, SessionView, Tool } from "./session";

const AXES = ["1st", "2nd", "3rd"];

/** A tool as a form: a field for each argument, with what is in hand filled in. */
export function ToolForm({ tool, hand, view }: { tool: Tool | undefined; hand: Hand; view: SessionView }) {
  const [fields, setFields] = useState<Record<string, Field>>(() =>
    tool === undefined
      ? {}
      : Object.fromEntries(
          parametersOf(tool).map(([name, parameter]) => [name, firstValue(name, parameter, hand, view)]),
        ),
  );
  if (tool === undefined) return null;
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        hand.act({ tool: tool.name, arguments: argumentsOf(tool, fields) });
      }}
    >
      <Fieldset legend={words(tool.name)} p="sm">
        <Stack gap="xs">
          <Text size="xs">{tool.description}</Text>
          {parametersOf(tool).map(([name, parameter]) => (
            <ArgumentField
              key={name}
              name={name}
              parameter={parameter}
              required={isRequired(tool, name)}
              choices={choicesOf(name, parameter, hand, view)}
              value={fields[name] ?? ""}
              onChange={(value) => setFields((before) => ({ ...before, [name]: value }))}
            />
          ))}
          <Group>
            <Button type="submit" size="xs" variant="light" disabled={hand.busy}>
              {words(tool.name)}
            </Button>
          </Group>
        </Stack>
      </Fieldset>
    </form>
  );
}

interface FieldProps {
  name: string;
  parameter: Parameter;
  required: boolean;
  choices: string[] | null;
  value: Field;
  onChange: (value: Field) => void;
}

function ArgumentField({ name, parameter, required, choices, value, onChange }: FieldProps) {
  const shared = {
    label: words(name),
    description: parameter.description,
    size: "xs",
    withAsterisk: required,
  } as const;
  if (Array.isArray(value)) {
    return (
      <div>
        <Text size="xs" fw={500}>
          {words(name)}
        </Text>
        <Text size="xs" className="dimmed">
          {parameter.description}
        </Text>
        <Group gap={6} wrap="nowrap">
          {value.map((one, index) => (
            <NumberInput
              key={index}
              size="xs"
              aria-label={`${words(name)}, ${AXES[index] ?? index}`}
              value={one}
              step={0.1}
              onChange={(next) => onChange(value.map((old, at) => (at === index ? next : old)))}
            />
          ))}
        </Group>
      </div>
    );
  }
  if (parameter.type === "number" || parameter.type === "integer")
    return <NumberInput {...shared} value={value} onChange={onChange} />;
  if (choices !== null)
    return (
      <Select {...shared} searchable data={choices} value={String(value)} onChange={(next) => onChange(next ?? "")} />
    );
  return <TextInput {...shared} value={value} onChange={(event) => onChange(event.currentTarget.value)} />;
}
