import { Button, Table, Text } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { download } from "../../api/client";
import { jobFiles, type JobDetail } from "../../api/queries";
import { bytes } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";

/** What a job has made, to keep. */
export function JobFiles({ job }: { job: JobDetail }) {
  const query = useQuery(jobFiles(job.id));
  const [error, setError] = useState<unknown>(null);
  return (
    <Section title="Files">
      <Answered query={query} rows={3}>
        {(files) => (
          <>
            {error !== null && <ProblemNote error={error} />}
            {files.length === 0 && <Text size="sm">None yet.</Text>}
            <Table>
              <Table.Tbody>
                {files.map((file) => (
                  <Table.Tr key={file.name}>
                    <Table.Td>{file.name}</Table.Td>
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
    </Section>
  );
}
