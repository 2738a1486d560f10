import { Button, Group, Modal, NumberInput, Stack, Text } from "@mantine/core";
import { useDisclosure } from "@mantine/hooks";
import { IconCoin } from "@tabler/icons-react";
import { useMutation, useQueryClient } from "@tanstack/react-query";
import { useState } from "react";
import { client, taken } from "../../api/client";
import { sweep as sweepQuery, type Sweep } from "../../api/queries";
import { dollars } from "../../format";
import { ProblemNote } from "../../parts/Problem";

type Amount = number | string;

interface Limits {
  max_cost_usd: Amount;
  max_tokens: Amount;
  max_requests: Amount;
}

/** An amount as the service takes it; an empty field means no limit. */
function amount(value: Amount): number | null {
  const text = String(value).trim();
  return text === "" ? null : Number(text);
}

function limitsOf({ budget }: Sweep): Limits {
  return {
    max_cost_usd: budget?.max_cost_usd ?? "",
    max_tokens: budget?.max_tokens ?? "",
    max_requests: budget?.max_requests ?? "",
  };
}

/** A button that opens a sweep's budget, to be raised while it runs or once it is used up. */
export function BudgetForm({ sweep }: { sweep: Sweep }) {
  const [opened, form] = useDisclosure(false);
  return (
    <>
      <Button size="xs" variant="default" leftSection={<IconCoin size={15} aria-hidden />} onClick={form.open}>
        Budget…
      </Button>
      <Modal
        opened={opened}
        onClose={form.close}
        title={`Budget of ${sweep.name}`}
        closeButtonProps={{ "aria-label": "Close" }}
      >
        <Fields sweep={sweep} done={form.close} />
      </Modal>
    </>
  );
}

function Fields({ sweep, done }: { sweep: Sweep; done: () => void }) {
  const queries = useQueryClient();
  const [limits, setLimits] = useState(() => limitsOf(sweep));
  const saving = useMutation({
    mutationFn: () =>
      taken(
        client.PUT("/v1/sweeps/{sweep_id}/budget", {
          params: { path: { sweep_id: sweep.id } },
          body: {
            max_cost_usd: amount(limits.max_cost_usd),
            max_tokens: amount(limits.max_tokens),
            max_requests: amount(limits.max_requests),
          },
        }),
      ),
    onSuccess: (view) => {
      queries.setQueryData(sweepQuery(sweep.id).queryKey, view);
      void queries.invalidateQueries();
      done();
    },
  });
  const field = (name: keyof Limits, label: string, spent: string, whole: boolean) => (
    <NumberInput
      label={label}
      description={`${spent} so far; empty: no limit`}
      value={limits[name]}
      min={0}
      allowDecimal={!whole}
      allowNegative={false}
      onChange={(value) => setLimits({ ...limits, [name]: value })}
    />
  );
  const { budget, progress } = sweep;
  const tokens = budget?.used_tokens ?? (progress.usage.input_tokens ?? 0) + (progress.usage.output_tokens ?? 0);
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        saving.mutate();
      }}
    >
      <Stack>
        {sweep.state === "budget_exhausted" && (
          <Text size="sm">With a larger budget the sweep continues where it stopped.</Text>
        )}
        {field("max_cost_usd", "US dollars", dollars(budget?.used_cost_usd ?? progress.usage.cost_usd), false)}
        {field("max_tokens", "Tokens, in and out", tokens.toLocaleString("en"), true)}
        {field(
          "max_requests",
          "Model requests",
          (budget?.used_requests ?? progress.usage.requests ?? 0).toLocaleString("en"),
          true,
        )}
        {saving.error !== null && <ProblemNote error={saving.error} />}
        <Group justify="end">
          <Button variant="default" onClick={done}>
            Leave it
          </Button>
          <Button type="submit" loading={saving.isPending}>
            Set the budget
          </Button>
        </Group>
      </Stack>
    </form>
  );
}
