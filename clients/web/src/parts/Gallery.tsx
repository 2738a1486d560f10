import { Badge, Card, Group, SimpleGrid, Skeleton, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useCallback } from "react";
import { bytesOf } from "../api/client";
import type { Job } from "../api/queries";
import { number, words } from "../format";
import { OutcomeBadge } from "./Outcome";

/** Machines by their pictures; each leads to its job. */
export function Gallery({ jobs, unit, by }: { jobs: readonly Job[]; unit?: string; by: "model" | "task" }) {
  return (
    <SimpleGrid cols={{ base: 1, xs: 2, md: 4 }}>
      {jobs.map((job) => (
        <Card key={job.id} withBorder padding="sm" pos="relative">
          <Card.Section>
            <Thumbnail id={job.id} label={`The machine of ${job.model} on ${job.task}, seed ${job.seed}`} />
          </Card.Section>
          <Link className="quiet covering" to="/jobs/$id" params={{ id: job.id }}>
            <Text fw={600} size="sm" mt={6}>
              {job[by]}, seed {job.seed}
            </Text>
          </Link>
          <Text size="sm" className="figures">
            {job.censored ? "≥ " : ""}
            {number(job.indicator)} {unit ?? ""}
          </Text>
          <Group gap={6} mt={4}>
            <OutcomeBadge value={job.outcome ?? job.state} size="sm" />
            {job.flags.map((flag) => (
              <Badge
                key={flag}
                size="sm"
                color="yellow"
                variant="outline"
                tt="none"
                styles={{ root: { color: "inherit" } }}
              >
                {words(flag)}
              </Badge>
            ))}
          </Group>
          {(job.detail ?? job.reason) !== null && job.outcome !== "success" && (
            <Text size="xs" className="dimmed" lineClamp={3} mt={4}>
              {job.detail ?? words(job.reason ?? "")}
            </Text>
          )}
        </Card>
      ))}
    </SimpleGrid>
  );
}

/** A machine's picture; read with the key, which no picture's address could carry. */
export function Thumbnail({ id, label, height = 150 }: { id: string; label: string; height?: number }) {
  const query = useQuery({
    queryKey: ["thumbnail", id],
    staleTime: Infinity,
    retry: false,
    queryFn: async () =>
      new Blob([await bytesOf(`/v1/jobs/${encodeURIComponent(id)}/thumbnail.png`, "image/png")], { type: "image/png" }),
  });
  const { data } = query;
  const show = useCallback(
    (image: HTMLImageElement) => {
      if (data === undefined) return;
      const address = URL.createObjectURL(data);
      image.src = address;
      return () => URL.revokeObjectURL(address);
    },
    [data],
  );
  if (query.isError) {
    return (
      <Text size="xs" className="dimmed" ta="center" py={height / 4}>
        no picture
      </Text>
    );
  }
  if (data === undefined) return <Skeleton height={height} radius={0} />;
  return (
    <img
      ref={show}
      alt={label}
      style={{ width: "100%", height, objectFit: "cover", display: "block", background: "#eef1f4" }}
    />
  );
}
