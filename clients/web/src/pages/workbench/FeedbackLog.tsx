import { Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { words } from "../../format";
import { transcript as transcriptQuery } from "../job/queries";
import { callLine } from "../job/transcript";

const SHOWN = 30;

/** Actions so far and their results, the newest first. */
export function FeedbackLog({ id }: { id: string }) {
  const query = useQuery({ ...transcriptQuery(id), staleTime: 0 });
  const turns = query.data?.turns ?? [];
  if (turns.length < 2) return null;
  const before = turns.slice(0, -1);
  return (
    <section aria-label="Earlier actions">
      <Text size="sm" fw={600}>
        Earlier actions{before.length > SHOWN ? `: the last ${SHOWN} of ${before.length}` : ""}
      </Text>
      <div className="log" tabIndex={0} role="region" aria-label="Earlier actions, scrolls">
        {before
          .slice(-SHOWN)
          .reverse()
          .map((turn) =>
            turn.actions.map((action, index) => (
              <div key={`${turn.index} ${index}`} className="log-entry">
                <span className="call">
                  {action.ok ? "✓" : `✗ ${words(action.reason ?? "refused")}:`} {callLine(action)}
                </span>
                <p className="feedback">{action.feedback}</p>
              </div>
            )),
          )}
      </div>
    </section>
  );
}
