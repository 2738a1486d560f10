import { Button, Table } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useQuery } from "@tanstack/react-query";
import { useState } from "react";
import { download } from "../../api/client";
import { jobFiles, type JobDetail } from "../../api/queries";
import { bytes } from "../../format";
import { ProblemNote } from "../../parts/Problem";
import { Answered, Empty } from "../../parts/States";

/** What a file's name ends with, by its media type. */
const endingOf = (type: string): string => ["json", "parquet"].find((ending) => type.includes(ending)) ?? "bin";

/** What a job has made, to keep. */
export function JobFiles({ job }: { job: JobDetail }) {
  const query = useQuery(jobFiles(job.id));
  const [error, setError] = useState<unknown>(null);
  const at = `/v1/jobs/${encodeURIComponent(job.id)}`;
  const model = { name: "machine.glb", size: null, path: `${at}/machine.glb`, as: `${job.id}.glb` };
  return (
    <Answered query={query} rows={3}>
      {(files) => {
        const rows = files.map(({ name, size, media_type }) => ({
          name,
          size,
          path: `${at}/artifacts/${encodeURIComponent(name)}`,
          as: `${job.id}-${name}.${endingOf(media_type)}`,
        }));
        if (rows.length === 0) return <Empty title="No file yet" />;
        return (
          <>
            {error !== null && <ProblemNote error={error} />}
            <Table maw={560}>
              <Table.Tbody>
                {[...(job.artifacts.machine === undefined ? [] : [model]), ...rows].map(({ name, size, path, as }) => (
                  <Table.Tr key={name}>
                    <Table.Td>{name}</Table.Td>
                    <Table.Td className="figures">{size === null ? "" : bytes(size)}</Table.Td>
                    <Table.Td ta="right">
                      <Button
                        size="compact-sm"
                        variant="default"
                        leftSection={<IconDownload size={14} aria-hidden />}
                        aria-label={`Save ${name}`}
                        onClick={() => void download(path, as).catch(setError)}
                      >
                        Save
                      </Button>
                    </Table.Td>
                  </Table.Tr>
                ))}
              </Table.Tbody>
            </Table>
          </>
        );
      }}
    </Answered>
  );
}
