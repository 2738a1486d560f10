import { Stack, Text, Title } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { getRouteApi, Link } from "@tanstack/react-router";
import { IconFileUpload } from "@tabler/icons-react";
import { useState } from "react";
import { jsonOf } from "../../api/client";
import { job as jobQuery } from "../../api/queries";
import { DropZone } from "../../parts/DropZone";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Loading } from "../../parts/States";
import { DriveRoom } from "./DriveRoom";
import type { DriveSearch } from "./search";

const route = getRouteApi("/drive");

type Document = Record<string, unknown>;

/** Where the document of the machine that is named in the address is. */
function addressOf({ job, session }: DriveSearch): string | null {
  if (session !== undefined) return `/v1/sessions/${session}/machine`;
  return job === undefined ? null : `/v1/jobs/${job}/artifacts/machine`;
}

/** A machine is driven live, by keys and touch. */
export default function DrivePage() {
  const search = route.useSearch();
  const address = addressOf(search);
  const [dropped, setDropped] = useState<Document | null>(null);
  const [problem, setProblem] = useState<Error | null>(null);
  const machine = useQuery({
    queryKey: ["machine-document", address],
    enabled: address !== null,
    staleTime: 0,
    queryFn: () => jsonOf<Document>(address ?? ""),
  });
  const id = search.session ?? search.job;
  const job = useQuery({ ...jobQuery(id ?? ""), enabled: id !== undefined });
  const read = async (file: File | null): Promise<void> => {
    if (file === null) return;
    try {
      setDropped(JSON.parse(await file.text()) as Document);
      setProblem(null);
    } catch {
      setProblem(new Error(`${file.name} is no machine document`));
    }
  };
  const document = dropped ?? machine.data;
  const task = search.task ?? job.data?.task;
  return (
    <Stack gap="md">
      <div>
        <Title order={1}>Drive</Title>
        <Text maw={720}>
          Hold a key, and your machine moves; let go, and it stops. It is the same physics as in every trial. With a
          name, the keys that you held are simulated again and scored, and stand on the board as human/your-name,
          piloted.
        </Text>
      </div>
      {machine.isError && <ProblemNote error={machine.error} retry={() => void machine.refetch()} />}
      {machine.isLoading && <Loading rows={8} />}
      {document === undefined && address === null && (
        <Section title="Which machine?">
          <Stack gap="sm">
            <Text size="sm">
              Every <Link to="/jobs">job</Link> with a machine has “Drive it”, and so has the{" "}
              <Link to="/build">build room</Link>. Or bring a machine document:
            </Text>
            <DropZone
              icon={<IconFileUpload size={32} aria-hidden />}
              title="Drop a machine document (JSON) here"
              hint="Up to 2 MiB and 2,000 parts."
              label="Machine document"
              accept=".json,application/json"
              busy={false}
              onFile={(file) => void read(file)}
            />
            {problem !== null && <ProblemNote error={problem} />}
          </Stack>
        </Section>
      )}
      {document !== undefined && (address === null || job.data !== undefined || job.isError) && (
        <DriveRoom key={address ?? "dropped"} machine={document} task={task} />
      )}
    </Stack>
  );
}
