import { Button, Group, Select, Stack, Text, TextInput, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { useState } from "react";
import type { TranscriptsSearch } from "../../api/jobs-search";
import { models, tasks, transcriptSearch, type TranscriptMatch } from "../../api/queries";
import { OutcomeBadge } from "../../parts/Outcome";
import { Answered, Empty } from "../../parts/States";

const route = getRouteApi("/transcripts");

/** Finds words in the transcripts of all jobs; each hit opens the turn it stands in. */
export default function TranscriptsPage() {
  const search = route.useSearch();
  const query = useQuery({ ...transcriptSearch(search), enabled: search.text !== undefined });
  return (
    <Stack gap="md">
      <div>
        <Title order={1}>Search transcripts</Title>
        <Text size="sm" className="dimmed">
          What models said and were answered, or what they were told before, in all jobs whose transcripts are not
          packed. Words are found in all their forms; “in quotes” as a phrase, “or” between two, “-” before what must
          not stand there.
        </Text>
      </div>
      <Fields key={JSON.stringify(search)} search={search} />
      {search.text !== undefined && (
        <Answered query={query} rows={8}>
          {(found) =>
            found.matches.length === 0 ? (
              <Empty title="No turn has these words">Fewer words find more.</Empty>
            ) : (
              <>
                <Text size="sm" className="dimmed" role="status">
                  {found.matches.length} {search.of === "prompts" ? "job" : "turn"}
                  {found.matches.length === 1 ? "" : "s"}, the newest jobs first
                  {found.complete ? "" : "; there are more: further words narrow them down"}
                </Text>
                {found.matches.map((match) => (
                  <Match key={`${match.job} ${match.turn ?? ""} ${match.where}`} match={match} />
                ))}
              </>
            )
          }
        </Answered>
      )}
    </Stack>
  );
}

function Fields({ search }: { search: TranscriptsSearch }) {
  const navigate = useNavigate({ from: "/transcripts" });
  const known = { tasks: useQuery(tasks()), models: useQuery(models()) };
  const [given, setGiven] = useState(search);
  const choice = (name: "task" | "model", label: string, data: string[]) => (
    <Select
      label={label}
      data={data}
      value={given[name] ?? null}
      placeholder="all"
      clearable
      searchable
      clearButtonProps={{ "aria-label": `Every ${name}` }}
      w={200}
      onChange={(value) => {
        setGiven({ ...given, [name]: value ?? undefined });
      }}
    />
  );
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        const text = given.text?.trim();
        void navigate({ search: { ...given, text: text === "" ? undefined : text } });
      }}
    >
      <Group align="end" gap="sm">
        <TextInput
          label="Words"
          placeholder="powered wheels"
          maxLength={200}
          value={given.text ?? ""}
          w={{ base: "100%", sm: 320 }}
          onChange={(event) => {
            setGiven({ ...given, text: event.currentTarget.value });
          }}
        />
        <Select
          label="In"
          data={[
            { value: "", label: "what was said and answered" },
            { value: "prompts", label: "what roles were told" },
          ]}
          value={given.of ?? ""}
          allowDeselect={false}
          w={220}
          onChange={(value) => {
            setGiven({ ...given, of: value === "prompts" ? value : undefined });
          }}
        />
        {choice(
          "task",
          "Task",
          (known.tasks.data ?? []).map((task) => task.name),
        )}
        {choice(
          "model",
          "Model",
          (known.models.data ?? []).map((model) => model.name),
        )}
        <Button type="submit" disabled={(given.text ?? "").trim() === ""}>
          Search
        </Button>
      </Group>
    </form>
  );
}

const WHERE: Readonly<Record<TranscriptMatch["where"], string>> = {
  reply: "said",
  feedback: "was answered",
  prompt: "was told before",
};

function Match({ match }: { match: TranscriptMatch }) {
  return (
    <article className="turn">
      <Group gap="xs">
        <Link to="/jobs/$id" params={{ id: match.job }} search={{ turn: match.turn ?? undefined }}>
          {match.task} by {match.model}, seed {match.seed}
          {match.turn === null ? "" : `, turn ${match.turn}`}
        </Link>
        {match.outcome !== null && <OutcomeBadge value={match.outcome} size="sm" />}
        <Text size="xs" className="dimmed">
          {WHERE[match.where]}
        </Text>
      </Group>
      <div className="turn-text">
        {match.excerpt.map((piece, index) =>
          piece.match ? <mark key={index}>{piece.text}</mark> : <span key={index}>{piece.text}</span>,
        )}
      </div>
    </article>
  );
}
