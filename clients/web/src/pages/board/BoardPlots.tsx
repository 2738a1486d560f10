import { SimpleGrid } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { figures, type Board } from "../../api/queries";
import { Section } from "../../parts/Section";
import { Answered } from "../../parts/States";
import { Costs } from "./Costs";
import { entriesOf } from "./entries";
import { Endings } from "./Failures";
import type { BoardSearch } from "../../api/board-search";

/** What the board means: cost against performance, how jobs end. */
export default function BoardPlots({ board, search }: { board: Board; search: BoardSearch }) {
  const query = useQuery(figures(search));
  const entries = entriesOf(board, search.baselines !== "no");
  return (
    <Answered query={query} rows={10}>
      {(found) => (
        <SimpleGrid cols={{ base: 1, md: 2 }}>
          <Section title="Cost and performance">
            <Costs figures={found} entries={entries} />
          </Section>
          <Endings figures={found} entries={entries} search={search} />
        </SimpleGrid>
      )}
    </Answered>
  );
}
