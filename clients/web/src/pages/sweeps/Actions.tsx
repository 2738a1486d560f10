import { Button, Group, Modal, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { notifications } from "@mantine/notifications";
import { IconBan, IconPlayerPause, IconPlayerPlay, IconRefresh } from "@tabler/icons-react";
import { useMutation, useQueryClient } from "@tanstack/react-query";
import { client, taken } from "../../api/client";
import { headline } from "../../api/problem";
import { sweep as sweepQuery, type Sweep } from "../../api/queries";
import { mayChange, useCaller } from "../../parts/permissions";
import { BudgetForm } from "./BudgetForm";

type Act = "pause" | "resume" | "cancel" | "retry";

/** What can be done with a sweep in its state. */
function possible(state: Sweep["state"]): readonly Act[] {
  if (state === "active") return ["pause", "cancel"];
  if (state === "paused" || state === "budget_exhausted") return ["resume", "cancel"];
  return [];
}

async function act(id: string, what: Act): Promise<Sweep> {
  const params = { params: { path: { sweep_id: id } } };
  if (what === "pause") return taken(client.POST("/v1/sweeps/{sweep_id}/pause", params));
  if (what === "resume") return taken(client.POST("/v1/sweeps/{sweep_id}/resume", params));
  if (what === "retry") return taken(client.POST("/v1/sweeps/{sweep_id}/retry", params));
  return taken(client.POST("/v1/sweeps/{sweep_id}/cancel", params));
}

/** What can be done with a sweep now. */
export function Actions({ sweep }: { sweep: Sweep }) {
  const queries = useQueryClient();
  const [asking, question] = useDisclosure(false);
  const doing = useMutation({
    mutationFn: (what: Act) => act(sweep.id, what),
    onSuccess: (view) => {
      queries.setQueryData(sweepQuery(sweep.id).queryKey, view);
      void queries.invalidateQueries();
    },
    onError: (error) => {
      notifications.show({ color: "red", title: headline(error), message: error.message });
    },
  });
  const who = useCaller();
  if (!mayChange(who, sweep.key_id)) return null;
  const can = possible(sweep.state);
  const button = (what: Act, label: string, icon: React.ReactNode, onClick: () => void) => (
    <Button
      key={what}
      size="xs"
      variant="default"
      leftSection={icon}
      loading={doing.isPending && doing.variables === what}
      onClick={onClick}
    >
      {label}
    </Button>
  );
  const left = sweep.progress.total - sweep.progress.done;
  return (
    <Group gap="xs">
      {can.includes("pause") &&
        button("pause", "Pause", <IconPlayerPause size={15} aria-hidden />, () => {
          doing.mutate("pause");
        })}
      {can.includes("resume") &&
        button("resume", "Resume", <IconPlayerPlay size={15} aria-hidden />, () => {
          doing.mutate("resume");
        })}
      {can.length > 0 && <BudgetForm sweep={sweep} />}
      {(sweep.progress.outcomes.errored ?? 0) > 0 &&
        sweep.state !== "cancelled" &&
        button(
          "retry",
          `Retry ${sweep.progress.outcomes.errored ?? 0} errored`,
          <IconRefresh size={15} aria-hidden />,
          () => {
            doing.mutate("retry");
          },
        )}
      {can.includes("cancel") && button("cancel", "Cancel…", <IconBan size={15} aria-hidden />, question.open)}
      <Modal
        opened={asking}
        onClose={question.close}
        title={`Cancel ${sweep.name}?`}
        closeButtonProps={{ "aria-label": "Close" }}
      >
        <Text size="sm">
          {left} jobs have not ended; those that no other sweep has end now. This cannot be taken back.
        </Text>
        <Group justify="end" mt="md">
          <Button variant="default" onClick={question.close}>
            Keep it
          </Button>
          <Button
            color="red"
            onClick={() => {
              question.close();
              doing.mutate("cancel");
            }}
          >
            Cancel the sweep
          </Button>
        </Group>
      </Modal>
    </Group>
  );
}
