import { Button, Checkbox, Group, PasswordInput, Stack } from "@mantine/core";
import { useQueryClient } from "@tanstack/react-query";
import { useState, useSyncExternalStore } from "react";
import { key, keyStays, onKey, setKey } from "../api/key";

export function useKey(): string | null {
  return useSyncExternalStore(onKey, key);
}

/** Where a key is given; it ends with this tab, unless the reader has it stay. */
export function KeyField() {
  const known = useKey();
  const [text, setText] = useState("");
  const [stays, setStays] = useState(keyStays);
  const queries = useQueryClient();
  const give = (value: string | null): void => {
    setKey(value, stays);
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
      <Stack gap="xs">
        <Group align="end" gap="xs">
          <PasswordInput
            label="API key"
            description={
              known === null ? "None is set" : keyStays() ? "One stays in this browser" : "One is in this tab"
            }
            value={text}
            autoComplete="off"
            placeholder={known === null ? "" : "one is set"}
            onChange={(event) => setText(event.currentTarget.value)}
            w={260}
          />
          <Button type="submit" disabled={text.trim() === ""}>
            Use
          </Button>
          {known !== null && (
            <Button variant="default" onClick={() => give(null)}>
              Forget
            </Button>
          )}
        </Group>
        <Checkbox
          size="xs"
          label="Remember on this device"
          checked={stays}
          onChange={(event) => {
            setStays(event.currentTarget.checked);
            if (known !== null) setKey(known, event.currentTarget.checked);
          }}
          maw={340}
        />
      </Stack>
    </form>
  );
}
