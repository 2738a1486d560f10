import { Button, Table, Text } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { download } from "../../api/client";
import { jobFiles, type JobDetail } from "../../api/queries";
import { bytes } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { Answered } from "../../parts/States";

/** What a file's name ends with, by its media type. */
const endingOf = (type: string): string => ["json", "parquet"].find((ending) => type.includes(ending)) ?? "bin";

/** What a job has made, to keep. */
export function JobFiles({ job }: { job: JobDetail }) {
  const query = useQuery(jobFiles(job.id));
  const [error, setError] = useState<unknown>(null);
  return (
    <Answered query={query} rows={3}>
      {(files) => (
        <>
          {error !== null && <ProblemNote error={error} />}
          {files.length === 0 && <Text size="sm">None yet.</Text>}
          <Table maw={560}>
            <Table.Tbody>
              {files.map(({ name, size, media_type }) => (
                <Table.Tr key={name}>
                  <Table.Td>{name}</Table.Td>
                  <Table.Td className="figures">{bytes(size)}</Table.Td>
                  <Table.Td ta="right">
                    <Button
                      size="compact-sm"
                      variant="default"
                      leftSection={<IconDownload size={14} aria-hidden />}
                      aria-label={`Save ${name}`}
                      onClick={() => {
                        const path = `/v1/jobs/${job.id}/artifacts/${encodeURIComponent(name)}`;
                        download(path, `${job.id}-${name}.${endingOf(media_type)}`).catch(setError);
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
