import { Button, Group, Text, TextInput } from "@mantine/core";
import { IconMovie, IconShare } from "@tabler/icons-react";
import { useState, type RefObject } from "react";
import { save } from "../api/client";
import type { Clock } from "./clock";
import { filmOf, pictureOf } from "./pictures";

interface ShareProps {
  /** What holds the drawing. */
  stage: RefObject<HTMLDivElement | null>;
  clock: Clock;
  /** Lines on a picture of it, the most important line first. */
  caption: readonly string[];
  /** The address of what is seen now. */
  address?: () => Promise<string>;
}

/** What can be shared: a link to this moment with a picture of it, or a film from here on. */
export function Share({ stage, clock, caption, address }: ShareProps) {
  const [message, setMessage] = useState<string | null>(null);
  const [link, setLink] = useState<string | null>(null);
  const [recording, setRecording] = useState<(() => void) | null>(null);
  const canvas = (): HTMLCanvasElement | null => stage.current?.querySelector("canvas") ?? null;
  const share = async (): Promise<void> => {
    const drawn = canvas();
    if (drawn === null) return;
    const text = await address?.();
    save(await pictureOf(drawn, caption), `trial-${clock.shown.toFixed(2)}s.png`);
    if (text === undefined) return;
    try {
      await navigator.clipboard.writeText(text);
      setMessage("The link is copied, and the picture saved.");
      setLink(null);
    } catch {
      // Without a secure address a page may not write there: it can be copied by hand.
      setLink(text);
    }
  };
  const film = async (): Promise<void> => {
    const drawn = canvas();
    if (drawn === null) return;
    const begun = clock.shown;
    if (!clock.playing) clock.toggle();
    try {
      const data = await filmOf(drawn, (stop) => setRecording(() => stop));
      save(data, `trial-from-${begun.toFixed(2)}s.webm`);
    } catch {
      setMessage("This browser records no films.");
    }
    setRecording(null);
  };
  return (
    <Group gap="xs">
      <Button
        size="compact-sm"
        variant="default"
        leftSection={<IconShare size={14} aria-hidden />}
        onClick={() => void share()}
      >
        Share
      </Button>
      <Button
        size="compact-sm"
        variant={recording === null ? "default" : "filled"}
        leftSection={<IconMovie size={14} aria-hidden />}
        onClick={() => (recording === null ? void film() : recording())}
      >
        {recording === null ? "Record film" : "Stop and save the film"}
      </Button>
      {link !== null && <TextInput size="xs" readOnly value={link} aria-label="To be copied" />}
      <Text size="xs" role="status">
        {message}
      </Text>
    </Group>
  );
}
