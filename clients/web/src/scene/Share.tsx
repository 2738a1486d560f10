import { Button, Group, Text, TextInput } from "@mantine/core";
import { IconCamera, IconLink, IconMovie } from "@tabler/icons-react";
import { useState, type RefObject } from "react";
import { save } from "../api/client";
import type { Clock } from "./clock";
import { filmOf, pictureOf } from "./pictures";

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
  const copy = async (): Promise<void> => {
    if (address === undefined) return;
    const text = await address();
    try {
      await navigator.clipboard.writeText(text);
      setTold("The link is copied.");
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
          onClick={() => void copy()}
        >
          Copy link to this moment
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
      {link !== null && <TextInput size="xs" readOnly value={link} aria-label="Link to this moment" />}
      <Text size="xs" role="status">
        {told}
      </Text>
    </Group>
  );
}
