import { Alert, Stack, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { sweepFaults, type Sweep, type SweepFault } from "../../api/queries";
import { counted } from "../../format";
import { RelativeTime } from "../../parts/RelativeTime";

/** What went wrong at providers and workers, a line for each cause: it never counts as a failure of a model. */
export function FaultList({ sweep }: { sweep: Sweep }) {
  const found = useQuery(sweepFaults(sweep.id)).data ?? [];
  const errored = sweep.progress.outcomes.errored ?? 0;
  if (found.length === 0 && errored === 0) return null;
  return (
    <Alert color={errored > 0 ? "pink" : "yellow"} title="Faults of providers and workers">
      <Stack gap={4}>
        {errored > 0 && (
          <Text size="sm">
            <Link to="/jobs" search={{ sweep: sweep.id, outcome: "errored" }}>
              {counted(errored, "run")} hit an error
            </Link>{" "}
            (not counted until retried)
          </Text>
        )}
        {found.map((one) => (
          <Text
            key={`${one.model} ${one.stage} ${one.result} ${one.detail ?? ""}`}
            size="sm"
            style={{ overflowWrap: "anywhere" }}
          >
            {one.model}: {causeOf(one)} ({counted(one.attempts, "try", "tries")}, {counted(one.jobs, "run")}; last{" "}
            <RelativeTime time={one.last_at} />)
          </Text>
        ))}
      </Stack>
    </Alert>
  );
}

const CAUSES = { lost: "its worker was lost", waiting: "no answer yet", retried: "asked again", fault: "a fault" };
const causeOf = ({ detail, result }: SweepFault): string => detail ?? CAUSES[result];
