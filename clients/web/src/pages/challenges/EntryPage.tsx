import { Group, Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi } from "@tanstack/react-router";
import { lazy, Suspense } from "react";
import { number } from "../../format";
import { Fact } from "../../parts/Fact";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Answered, Empty, Loading } from "../../parts/States";
import { Findings } from "./Findings";
import { entry, entryPicture, type PackageDetail, type Report } from "./queries";

const FileScene = lazy(() => import("../../scene/FileScene"));
const FlightView = lazy(() => import("./FlightView"));

const route = getRouteApi("/challenges/$name/$entry");

/** What somebody handed in: its machine, its flight, every check. */
export default function EntryPage() {
  const { entry: id } = route.useParams();
  const query = useQuery(entry(id));
  return <Answered query={query}>{(shown) => <Shown entry={shown} />}</Answered>;
}

function Shown({ entry: shown }: { entry: PackageDetail }) {
  const passed = shown.state === "scored" || shown.state === "accepted";
  return (
    <Stack gap="lg">
      <div>
        <Title order={1}>{shown.name}</Title>
        <Text>
          {shown.state}
          {shown.reason !== null && `: ${shown.reason}`}
        </Text>
      </div>
      <Group gap="xl">
        <Fact name="Points" value={number(shown.points, 2)} />
        <Fact name="Cost" value={number(shown.cost, 0)} />
      </Group>
      {passed && <Picture id={shown.id} />}
      <Section title="Checks">
        {shown.report === null ? (
          <Empty title="It has not been checked yet" />
        ) : (
          <Findings report={shown.report as unknown as Report} />
        )}
      </Section>
      {shown.changes.length > 0 && (
        <Section title="Decisions">
          {shown.changes.map((change) => (
            <Text key={change.at} size="sm">
              {change.state_before} → {change.state}: {change.reason}
            </Text>
          ))}
        </Section>
      )}
    </Stack>
  );
}

function Picture({ id }: { id: string }) {
  const query = useQuery(entryPicture(id));
  if (query.isError) return <ProblemNote error={query.error} />;
  if (query.data === undefined) return <Loading rows={10} />;
  const { machines, flight } = query.data;
  return (
    <Suspense fallback={<Loading rows={10} />}>
      {Object.entries(machines).map(([file, scene]) => (
        <Section key={file} title={file}>
          <FileScene scene={scene} label={`The machine of ${file}`} />
        </Section>
      ))}
      {flight !== null && (
        <Section title="Flight">
          <FlightView flight={flight} />
        </Section>
      )}
    </Suspense>
  );
}
