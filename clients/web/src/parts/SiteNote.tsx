import { Container, Text } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { site } from "../api/queries";
import { moment } from "../format";

/** What a published site holds, what was left out of it, and when it was written. */
export function SiteNote() {
  const { data } = useQuery(site());
  if (data === undefined) return null;
  return (
    <Container component="footer" size="var(--page-width)" py="lg" aria-label="About this site">
      <Text size="sm" className="dimmed">
        A published copy, written on <time dateTime={data.written_at}>{moment(data.written_at)}</time>. {data.holds}{" "}
        {data.left_out.join(" ")}
      </Text>
    </Container>
  );
}
