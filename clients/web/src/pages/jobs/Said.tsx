import { Group, Stack, Text, TextInput } from "@mantine/core";
import { useQuery } from "@tanstack/react-query";
import { Link } from "@tanstack/react-router";
import { useState } from "react";
import { client, taken } from "../../api/client";
import { Answered } from "../../parts/States";

/** Finds words in what models said and were answered, in all jobs; each hit opens its turn. */
export function Said() {
  const [typed, setTyped] = useState("");
  const [text, setText] = useState("");
  const query = useQuery({
    queryKey: ["transcripts", text],
    enabled: text !== "",
    staleTime: 60_000,
    queryFn: () => taken(client.GET("/v1/transcripts", { params: { query: { text } } })),
  });
  return (
    <Stack gap="xs">
      <form
        onSubmit={(event) => {
          event.preventDefault();
          setText(typed.trim());
        }}
      >
        <TextInput
          label="Said in transcripts"
          placeholder="words, then Enter"
          maxLength={200}
          value={typed}
          w={{ base: "100%", sm: 356 }}
          onChange={(event) => setTyped(event.currentTarget.value)}
        />
      </form>
      {text !== "" && (
        <Answered query={query} rows={4}>
          {({ data: matches }) => (
            <Group gap="xs" role="status">
              {matches.length === 0 && <Text size="sm">No turn has these words.</Text>}
              {matches.map((match) => (
                <article key={`${match.job_id} ${match.turn ?? ""} ${match.where}`} className="turn turn-text">
                  <Link to="/jobs/$id" params={{ id: match.job_id }} search={{ turn: match.turn ?? undefined }}>
                    {match.task} by {match.model}, seed {match.seed}, turn {match.turn}
                  </Link>{" "}
                  {match.excerpt.map((piece, index) =>
                    piece.match ? <mark key={index}>{piece.text}</mark> : <span key={index}>{piece.text}</span>,
                  )}
                </article>
              ))}
            </Group>
          )}
        </Answered>
      )}
    </Stack>
  );
}
