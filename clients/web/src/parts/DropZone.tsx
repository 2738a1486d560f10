import { Button, FileButton, Stack, Text } from "@mantine/core";
import { useState, type DragEvent, type ReactNode } from "react";

/** A place to drop a file, or to choose one by a button. */
export function DropZone({
  icon,
  title,
  hint,
  label,
  accept,
  busy,
  onFile,
}: {
  icon: ReactNode;
  title: string;
  hint: string;
  /** What the file is called for those who do not see the place. */
  label: string;
  accept: string;
  busy: boolean;
  onFile: (file: File | null) => void;
}) {
  const [over, setOver] = useState(false);
  const onDrop = (event: DragEvent): void => {
    event.preventDefault();
    setOver(false);
    onFile(event.dataTransfer.files[0] ?? null);
  };
  return (
    <div
      className="drop"
      data-over={over ? "" : undefined}
      onDragOver={(event) => {
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={() => {
        setOver(false);
      }}
      onDrop={onDrop}
    >
      <Stack align="center" gap="xs">
        {icon}
        <Text fw={600}>{title}</Text>
        <FileButton onChange={onFile} accept={accept} inputProps={{ "aria-label": label }}>
          {(props) => (
            <Button variant="default" loading={busy} {...props}>
              Choose a file
            </Button>
          )}
        </FileButton>
        <Text size="xs" className="dimmed">
          {hint}
        </Text>
      </Stack>
    </div>
  );
}
