import { Button, Group, Stack, Text, TextInput, Title } from "@mantine/core";
import { getRouteApi, useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import { Section } from "../../parts/Section";
import { ComparedJobs } from "./ComparedJobs";
import { ComparedModels } from "./ComparedModels";
import { ModelPickers } from "./ModelPickers";
import { scoped, type CompareSearch } from "./search";

const route = getRouteApi("/compare");

/** Two jobs in step, or two models on the same tasks. */
export default function ComparePage() {
  const search = route.useSearch();
  const [first, second] = (search.models ?? "").split(",").map((name) => name.trim());
  return (
    <Stack gap="lg">
      <Title order={1}>Compare</Title>
      {search.a !== undefined && search.b !== undefined && (
        <ComparedJobs key={`${search.a} ${search.b}`} ids={[search.a, search.b]} />
      )}
      {first !== undefined && first !== "" && second !== undefined && second !== "" && (
        <ComparedModels first={first} second={second} scope={scoped(search)} />
      )}
      <Chooser key={JSON.stringify(search)} search={search} />
    </Stack>
  );
}

function Chooser({ search }: { search: CompareSearch }) {
  const navigate = useNavigate({ from: "/compare" });
  const [jobs, setJobs] = useState([search.a ?? "", search.b ?? ""]);
  return (
    <Section title="Choose what to compare">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void navigate({ search: { a: jobs[0]?.trim(), b: jobs[1]?.trim() } });
        }}
      >
        <Group align="end" mb="md">
          {["First job", "Second job"].map((label, index) => (
            <TextInput
              key={label}
              label={label}
              placeholder="job_…"
              value={jobs[index] ?? ""}
              onChange={(event) => {
                const value = event.currentTarget.value;
                setJobs((before) => before.map((one, place) => (place === index ? value : one)));
              }}
              w={260}
            />
          ))}
          <Button type="submit" variant="default" disabled={jobs.some((one) => one.trim() === "")}>
            Compare jobs
          </Button>
        </Group>
      </form>
      <ModelPickers search={search} />
      <Text size="xs" className="dimmed" mt="xs">
        The address of this page says what is compared, so it can be sent to a colleague.
      </Text>
    </Section>
  );
}
