import { Button, Menu } from "@mantine/core";
import { IconDownload } from "@tabler/icons-react";
import { useState } from "react";
import { download } from "../../api/client";
import { boardQuery } from "../../api/queries";
import { ProblemNote } from "../../parts/Problem";
import type { BoardSearch } from "../../api/board-search";

const FORMATS: Readonly<Record<string, { label: string; ending: string }>> = {
  csv: { label: "CSV", ending: "csv" },
  parquet: { label: "Parquet", ending: "parquet" },
  latex: { label: "LaTeX table", ending: "tex" },
  json: { label: "JSON", ending: "json" },
};

/** The address of exactly what the board shows, as data. */
export function exportPath(track: string, search: BoardSearch, format: string): string {
  const words = new URLSearchParams();
  for (const [name, value] of Object.entries<string | string[]>({ ...boardQuery(search), track })) {
    for (const one of Array.isArray(value) ? value : [value]) words.append(name, one);
  }
  if (format === "json") return `/v1/leaderboard?${words.toString()}`;
  words.set("format", format);
  return `/v1/leaderboard/export?${words.toString()}`;
}

/** Saves exactly what is shown, as data. */
export function Exports({ track, search }: { track: string; search: BoardSearch }) {
  const [error, setError] = useState<unknown>(null);
  const save = (format: string, ending: string): void => {
    setError(null);
    download(exportPath(track, search, format), `leaderboard.${ending}`).catch(setError);
  };
  return (
    <>
      <Menu position="bottom-end">
        <Menu.Target>
          <Button variant="default" size="xs" leftSection={<IconDownload size={15} aria-hidden />}>
            Download
          </Button>
        </Menu.Target>
        <Menu.Dropdown>
          {Object.entries(FORMATS).map(([format, { label, ending }]) => (
            <Menu.Item key={format} onClick={() => save(format, ending)}>
              {label}
            </Menu.Item>
          ))}
        </Menu.Dropdown>
      </Menu>
      {error !== null && <ProblemNote error={error} />}
    </>
  );
}
