import { Button, Group, Text, TextInput } from "@mantine/core";
import { IconCamera, IconFrame, IconLink, IconMovie } from "@tabler/icons-react";
import { useState, type RefObject } from "react";
import { save } from "../api/client";
import type { Clock } from "./clock";
import { embedding, filmOf, pictureOf } from "./pictures";

interface ShareProps {
  /** What holds the drawing. */
  stage: RefObject<HTMLDivElement | null>;
  clock: Clock;
  /** The address of what is seen now. */
  address?: () => Promise<string>;
}

/** What can be sent to somebody: a link to this moment, a picture of it, a film from here on. */
export function Share({ stage, clock, address }: ShareProps) {
  const [told, setTold] = useState<string | null>(null);
  const [link, setLink] = useState<string | null>(null);
  const [recording, setRecording] = useState<(() => void) | null>(null);
  const canvas = (): HTMLCanvasElement | null => stage.current?.querySelector("canvas") ?? null;
  const copy = async (made: (address: string) => string, done: string): Promise<void> => {
    if (address === undefined) return;
    const text = made(await address());
    try {
      await navigator.clipboard.writeText(text);
      setTold(done);
      setLink(null);
    } catch {
      // Without a secure address a page may not write there: it can be copied by hand.
      setLink(text);
    }
  };
  const picture = async (): Promise<void> => {
    const drawn = canvas();
    if (drawn === null) return;
    save(await pictureOf(drawn), `trial-${clock.shown.toFixed(2)}s.png`);
  };
  const film = async (): Promise<void> => {
    const drawn = canvas();
    if (drawn === null) return;
    const begun = clock.shown;
    if (!clock.playing) clock.toggle();
    try {
      const data = await filmOf(drawn, (stop) => {
        setRecording(() => stop);
      });
      save(data, `trial-from-${begun.toFixed(2)}s.webm`);
    } catch {
      setTold("This browser records no films.");
    }
    setRecording(null);
  };
  return (
    <Group gap="xs">
      {address !== undefined && (
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<IconLink size={14} aria-hidden />}
          onClick={() => void copy((link) => link, "The link is copied.")}
        >
          Copy link to this moment
        </Button>
      )}
      {address !== undefined && (
        <Button
          size="compact-xs"
          variant="default"
          leftSection={<IconFrame size={14} aria-hidden />}
          onClick={() => void copy(embedding, "The frame is copied: paste it into a page.")}
        >
          Copy frame for a page
        </Button>
      )}
      <Button
        size="compact-xs"
        variant="default"
        leftSection={<IconCamera size={14} aria-hidden />}
        onClick={() => void picture()}
      >
        Save picture
      </Button>
      <Button
        size="compact-xs"
        variant={recording === null ? "default" : "filled"}
        leftSection={<IconMovie size={14} aria-hidden />}
        onClick={() => {
          if (recording === null) void film();
          else recording();
        }}
      >
        {recording === null ? "Record film" : "Stop and save the film"}
      </Button>
      {link !== null && <TextInput size="xs" readOnly value={link} aria-label="To be copied" />}
      <Text size="xs" role="status">
        {told}
      </Text>
    </Group>
  );
}
