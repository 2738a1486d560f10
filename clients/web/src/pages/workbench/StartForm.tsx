import { Alert, Anchor, Button, Group, NumberInput, Select, Stack, Text, TextInput, Title } from "@mantine/core";
import { IconHammer } from "@tabler/icons-react";
import { useMutation, useQuery } from "@tanstack/react-query";
import { getRouteApi, Link, useNavigate } from "@tanstack/react-router";
import { useState, type SubmitEvent } from "react";
import { client, taken } from "../../api/client";
import { tasks as tasksQuery } from "../../api/queries";
import { Markdown } from "../../parts/Markdown";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { remix } from "./remix";
import { rememberSession, useLastSession } from "./session";
import { callsOf, make, templatesFor } from "./templates";

const route = getRouteApi("/build");
const FIRST = "transport-1";
const NAME = "buildarena-name";

/** Which task, under which name: the beginning of a session. */
export function StartForm() {
  const search = route.useSearch();
  const navigate = useNavigate({ from: "/build" });
  const tasks = useQuery(tasksQuery());
  const last = useLastSession();
  const [task, setTask] = useState(search.task ?? FIRST);
  const [name, setName] = useState(() => localStorage.getItem(NAME) ?? "");
  const offered = search.remix === undefined ? templatesFor(task) : [];
  const [wanted, setWanted] = useState("");
  const template = offered.find(({ name }) => name === wanted);
  const [seed, setSeed] = useState<number | string>(0);
  const opening = useMutation({
    mutationFn: async () => {
      const opened = await taken(
        client.POST("/v1/sessions", {
          body: {
            task,
            agent: name.trim(),
            seed: Number(seed),
            simulator: "pybullet",
            data_sheets: true,
            kind: "human",
          },
        }),
      );
      // One that was open already has something on its workbench.
      if (search.remix !== undefined && opened.calls === 0) await remix(search.remix, opened.id);
      else if (template !== undefined && opened.calls === 0) await make(callsOf(template), opened.id);
      return opened;
    },
    onSuccess: ({ id }) => {
      localStorage.setItem(NAME, name.trim());
      rememberSession(id);
      void navigate({ search: { session: id } });
    },
  });
  const chosen = tasks.data?.find((one) => one.name === task);
  const begin = (event: SubmitEvent): void => {
    event.preventDefault();
    opening.mutate();
  };
  return (
    <Stack gap="md">
      <div>
        <Title order={1}>Build by hand</Title>
        <Text maw={720}>
          Put blocks together, press Start, and see whether your machine does it. You get the same tools, rules and
          answers as the models, and your result is on the leaderboard of the external track as human/your-name.
        </Text>
      </div>
      {search.remix !== undefined && (
        <Alert color="teal" title="A remix">
          The session begins with the machine of{" "}
          <Link to="/jobs/$id" params={{ id: search.remix }}>
            this job
          </Link>
          , built again step by step. Change what you like.
        </Alert>
      )}
      {last !== undefined && (
        <Alert color="blue" title="You have a session under way">
          <Link to="/build" search={{ session: last.job.id }}>
            Go on with {last.job.task} as {last.job.model}, seed {last.job.seed} ({last.calls} actions so far)
          </Link>
        </Alert>
      )}
      <Section title="New session">
        <form onSubmit={begin}>
          <Stack gap="sm">
            <Group align="end" gap="sm">
              <Select
                label="Task"
                searchable
                data={(tasks.data ?? []).map((one) => ({ value: one.name, label: `${one.name}: ${one.title}` }))}
                value={task}
                onChange={(value) => setTask(value ?? FIRST)}
                allowDeselect={false}
                w={{ base: "100%", xs: 320 }}
              />
              <TextInput
                label="Your name on the board"
                placeholder="ada"
                required
                maxLength={80}
                value={name}
                onChange={(event) => setName(event.currentTarget.value)}
                w={{ base: "100%", xs: 220 }}
              />
              {offered.length > 0 && (
                <Select
                  label="Begin with"
                  data={[
                    { value: "", label: "nothing" },
                    ...offered.map(({ name, about }) => ({ value: name, label: `${name}: ${about}` })),
                  ]}
                  value={template?.name ?? ""}
                  allowDeselect={false}
                  onChange={(value) => setWanted(value ?? "")}
                  w={{ base: "100%", xs: 260 }}
                />
              )}
              <NumberInput label="Seed" min={0} allowDecimal={false} value={seed} onChange={setSeed} w={100} />
              <Button type="submit" leftSection={<IconHammer size={16} aria-hidden />} loading={opening.isPending}>
                Begin
              </Button>
            </Group>
            <Text size="xs" className="dimmed">
              Letters, digits, dots, dashes and underscores. Come back any time: the same name continues.
            </Text>
            {opening.isError && <ProblemNote error={opening.error} />}
          </Stack>
        </form>
      </Section>
      {chosen !== undefined && (
        <Section
          title={`What ${chosen.name} asks for`}
          aside={
            <Anchor component={Link} to={`/tasks/${chosen.name}`} size="sm">
              The task in 3D
            </Anchor>
          }
        >
          <Markdown text={chosen.statement} />
        </Section>
      )}
    </Stack>
  );
}
