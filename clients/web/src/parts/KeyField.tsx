import { Button, Group, PasswordInput } from "@mantine/core";
import { useQueryClient } from "@tanstack/react-query";
import { useState, useSyncExternalStore } from "react";
import { key, onKey, setKey } from "../api/key";

export function useKey(): string | null {
  return useSyncExternalStore(onKey, key);
}

/** Where a key is given; it stays in this tab and ends with it. */
export function KeyField() {
  const known = useKey();
  const [text, setText] = useState("");
  const queries = useQueryClient();
  const give = (value: string | null): void => {
    setKey(value);
    setText("");
    void queries.resetQueries();
  };
  return (
    <form
      onSubmit={(event) => {
        event.preventDefault();
        give(text);
      }}
    >
      <Group align="end" gap="xs">
        <PasswordInput
          label="API key"
          description="Kept in this tab only"
          value={text}
          autoComplete="off"
          placeholder={known === null ? "" : "one is set"}
          onChange={(event) => {
            setText(event.currentTarget.value);
          }}
          w={260}
        />
        <Button type="submit" disabled={text.trim() === ""}>
          Use
        </Button>
        {known !== null && (
          <Button
            variant="default"
            onClick={() => {
              give(null);
            }}
          >
            Forget
          </Button>
        )}
      </Group>
    </form>
  );
}
