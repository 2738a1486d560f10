import { Stack, Title } from "@mantine/core";
import { getRouteApi } from "@tanstack/react-router";
import { Section } from "../../parts/Section";
import { ComparedJobs } from "./ComparedJobs";
import { ComparedModels } from "./ComparedModels";
import { ModelPickers } from "./ModelPickers";
import { scoped } from "./search";

const route = getRouteApi("/compare");

/** The trials of two jobs in step, or two models on the same tasks. */
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
      <Section title="Choose two models">
        <ModelPickers key={JSON.stringify(search)} search={search} />
      </Section>
    </Stack>
  );
}
