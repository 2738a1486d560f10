import { Button, SimpleGrid, Table, Text } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { download } from "../../api/client";
import { jobFiles, type JobDetail } from "../../api/queries";
import { bytes, duration, secondsBetween } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";

/** What stands behind a result: files, attempts, versions. */
export function JobRecords({ job }: { job: JobDetail }) {
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }}>
      <Section title="Files">
        <Files job={job} />
      </Section>
      <Section title="Attempts">
        <Attempts job={job} />
      </Section>
      {job.manifest !== null && (
        <Section title="Manifest">
          <details>
            <summary style={{ cursor: "pointer" }}>Versions of everything that can change this result</summary>
            <Table fz="sm">
              <Table.Tbody>
                {flattened(job.manifest).map(([name, value]) => (
                  <Table.Tr key={name}>
                    <Table.Th fw={500} scope="row">
                      {name}
                    </Table.Th>
                    <Table.Td style={{ overflowWrap: "anywhere", fontFamily: "monospace", fontSize: 12 }}>
                      {value}
                    </Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </details>
        </Section>
      )}
    </SimpleGrid>
  );
}

/** A document's leaves by their paths. */
export function flattened(value: unknown, path = ""): [string, string][] {
  if (typeof value !== "object" || value === null) return [[path, String(value)]];
  return Object.entries(value).flatMap(([name, inner]) => flattened(inner, path === "" ? name : `${path}.${name}`));
}

function Files({ job }: { job: JobDetail }) {
  const query = useQuery(jobFiles(job.id));
  const [error, setError] = useState<unknown>(null);
  return (
    <Answered query={query} rows={3}>
      {(files) => (
        <>
          {error !== null && <ProblemNote error={error} />}
          {files.length === 0 && <Text size="sm">None yet.</Text>}
          <Table>
            <Table.Tbody>
              {files.map((file) => (
                <Table.Tr key={file.name}>
                  <Table.Td>
                    {file.name}
                    <Text size="xs" ff="monospace" className="dimmed" title={file.hash}>
                      sha256 {file.hash.slice(0, 16)}…
                    </Text>
                  </Table.Td>
                  <Table.Td className="figures">{bytes(file.size)}</Table.Td>
                  <Table.Td ta="right">
                    <Button
                      size="compact-sm"
                      variant="default"
                      leftSection={<IconDownload size={14} aria-hidden />}
                      aria-label={`Save ${file.name}`}
                      onClick={() => {
                        const ending = file.media_type.includes("json")
                          ? "json"
                          : file.media_type.includes("parquet")
                            ? "parquet"
                            : "bin";
                        download(
                          `/v1/jobs/${job.id}/artifacts/${encodeURIComponent(file.name)}`,
                          `${job.id}-${file.name}.${ending}`,
                        ).catch(setError);
                      }}
                    >
                      Save
                    </Button>
                  </Table.Td>
                </Table.Tr>
              ))}
            </Table.Tbody>
          </Table>
        </>
      )}
    </Answered>
  );
}

function Attempts({ job }: { job: JobDetail }) {
  if (job.attempts.length === 0) return <Text size="sm">No worker has taken it yet.</Text>;
  return (
    <Table fz="sm">
      <Table.Thead>
        <Table.Tr>
          <Table.Th>Stage</Table.Th>
          <Table.Th>Worker</Table.Th>
          <Table.Th className="figures">Took</Table.Th>
          <Table.Th>Result</Table.Th>
        </Table.Tr>
      </Table.Thead>
      <Table.Tbody>
        {job.attempts.map((attempt) => (
          <Table.Tr key={attempt.token}>
            <Table.Td>{attempt.stage}</Table.Td>
            <Table.Td style={{ overflowWrap: "anywhere" }}>{attempt.worker}</Table.Td>
            <Table.Td className="figures">{duration(secondsBetween(attempt.started_at, attempt.ended_at))}</Table.Td>
            <Table.Td>
              {attempt.result ?? "running"}
              {attempt.detail !== null && (
                <Text size="xs" className="dimmed">
                  {attempt.detail}
                </Text>
              )}
            </Table.Td>
          </Table.Tr>
        ))}
      </Table.Tbody>
    </Table>
  );
}
