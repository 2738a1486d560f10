import { SimpleGrid } from "@mantine/core";
import type { Figures } from "../../api/queries";
import { Section } from "../../parts/Section";
import type { Entry } from "../board/entries";
import { Endings, Refusals } from "../board/Failures";
import { Radar } from "../board/Radar";

/** A model's profile over difficulty dimensions, how its jobs end, and why its actions are refused. */
export default function Drawings({ figures, entries }: { figures: Figures; entries: readonly Entry[] }) {
  return (
    <SimpleGrid cols={{ base: 1, md: 2 }}>
      <Section title="Difficulty dimensions">
        <Radar figures={figures} entries={entries} />
      </Section>
      <Endings figures={figures} entries={entries} search={{}} />
      <Refusals figures={figures} entries={entries} />
    </SimpleGrid>
  );
}
