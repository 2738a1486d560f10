import { Alert, List, SegmentedControl, Stack, Table, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import { useState } from "react";
import { number } from "../../format";
import { Ago } from "../../parts/Ago";
import { Section } from "../../parts/Section";
import { Answered, Empty } from "../../parts/States";
import { HandIn } from "./HandIn";
import { ownPackages, season, seasonBoard, type PackageView, type Ranked, type SeasonView } from "./queries";

const route = getRouteApi("/challenges/$name");
const FIGURES: ReadonlySet<string> = new Set(["Rank", "Points", "Cost"]);

/** One season: rules, board, own packages, and a place to hand one in. */
export default function SeasonPage() {
  const { name } = route.useParams();
  const query = useQuery(season(name));
  return <Answered query={query}>{(view) => <Shown view={view} />}</Answered>;
}

function Shown({ view }: { view: SeasonView }) {
  const { season: rules } = view;
  const tracks = Object.entries(rules.tracks);
  const [track, setTrack] = useState(tracks[0]?.[0] ?? "");
  const board = useQuery(seasonBoard(rules.name, track));
  const own = useQuery(ownPackages(rules.name));
  return (
    <Stack gap="lg">
      <div>
        <Title order={1}>{rules.title}</Title>
        <Text maw={720}>{rules.about}</Text>
      </div>
      {view.unknown.length > 0 && (
        <Alert color="gray" title="Not published, so part of each score is not known">
          {view.unknown.join(", ")}
        </Alert>
      )}
      <SegmentedControl
        aria-label="Track"
        data={tracks.map(([value]) => ({ value, label: value }))}
        value={track}
        onChange={setTrack}
        style={{ alignSelf: "start" }}
      />
      <Text size="sm">{rules.tracks[track]?.title}</Text>
      <Section title="Board">
        <Answered query={board}>{(rows) => <Board rows={rows} />}</Answered>
      </Section>
      <HandIn season={rules} track={track} isOpen={view.is_open} />
      <Section title="Your packages">
        <Answered query={own}>{(listed) => <Own listed={listed} />}</Answered>
      </Section>
      <Section title="Rules">
        <Text size="sm">Score: {wordsOf(rules)}</Text>
        {rules.sources.length > 0 && (
          <List size="sm" mt="xs">
            {rules.sources.map((source) => (
              <List.Item key={source}>{source}</List.Item>
            ))}
          </List>
        )}
      </Section>
    </Stack>
  );
}

function wordsOf({ score }: SeasonView["season"]): string {
  if (score.formula === "trials") {
    const full = Object.entries(score.tasks).map(
      ([task, indicator]) => `${task} at ${number(indicator, indicator < 10 ? 1 : 0)}`,
    );
    return `100 times the mean over the tasks of indicator / full, at most 1; full are ${full.join(", ")}.`;
  }
  const { progress, speed, integrity, cycles } = score;
  return `100 (${progress} progress + ${speed} speed + ${integrity} integrity); progress is full at ${cycles} cycles.`;
}

function Board({ rows }: { rows: readonly Ranked[] }) {
  if (rows.length === 0) return <Empty title="No package has been scored on this track yet" />;
  return (
    <Scrolling name="Board of the season">
      <Head names={["Rank", "Entry", "Points", "Cost", "Handed in"]} />
      <Table.Tbody>
        {rows.map(({ rank, package: entry }) => (
          <Table.Tr key={entry.id}>
            <Table.Td className="figures">{rank}</Table.Td>
            <Table.Td>
              <EntryLink entry={entry} />
            </Table.Td>
            <Table.Td className="figures">{number(entry.points, 2)}</Table.Td>
            <Table.Td className="figures">{number(entry.cost, 0)}</Table.Td>
            <Table.Td>
              <Ago time={entry.created_at} />
            </Table.Td>
          </Table.Tr>
        ))}
      </Table.Tbody>
    </Scrolling>
  );
}

function Own({ listed }: { listed: readonly PackageView[] }) {
  if (listed.length === 0) return <Empty title="You have handed in nothing yet" />;
  return (
    <Scrolling name="Your packages">
      <Head names={["Entry", "Track", "State", "Points", "Handed in"]} />
      <Table.Tbody>
        {listed.map((entry) => (
          <Table.Tr key={entry.id}>
            <Table.Td>
              <EntryLink entry={entry} />
            </Table.Td>
            <Table.Td>{entry.track}</Table.Td>
            <Table.Td>{entry.state}</Table.Td>
            <Table.Td className="figures">{number(entry.points, 2)}</Table.Td>
            <Table.Td>
              <Ago time={entry.created_at} />
            </Table.Td>
          </Table.Tr>
        ))}
      </Table.Tbody>
    </Scrolling>
  );
}

function EntryLink({ entry }: { entry: PackageView }) {
  return (
    <Link className="quiet" to="/challenges/$name/$entry" params={{ name: entry.season, entry: entry.id }}>
      {entry.name}
    </Link>
  );
}

function Scrolling({ name, children }: { name: string; children: React.ReactNode }) {
  return (
    <Table.ScrollContainer
      minWidth={420}
      type="native"
      tabIndex={0}
      role="region"
      aria-label={`${name}, scrolls sideways`}
    >
      <Table fz="sm" aria-label={name} verticalSpacing={4}>
        {children}
      </Table>
    </Table.ScrollContainer>
  );
}

function Head({ names }: { names: readonly string[] }) {
  return (
    <Table.Thead>
      <Table.Tr>
        {names.map((name) => (
          <Table.Th key={name} className={FIGURES.has(name) ? "figures" : undefined}>
            {name}
          </Table.Th>
        ))}
      </Table.Tr>
    </Table.Thead>
  );
}
