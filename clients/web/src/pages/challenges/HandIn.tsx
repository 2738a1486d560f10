import { Alert, Button, Group, Stack, Text, TextInput } from "@mantine/core";
import { IconFileZip } from "@tabler/icons-react";
import { useEffect, useState } from "react";
import { DropZone } from "../../parts/DropZone";
import { ProblemNote } from "../../parts/Problem";
import { Section } from "../../parts/Section";
import { Findings } from "./Findings";
import { useHandIn, useLook, type Report, type Season } from "./queries";

/** A package: dropped, checked, and only then handed in. */
export function HandIn({ season, track, isOpen }: { season: Season; track: string; isOpen: boolean }) {
  const look = useLook();
  const handIn = useHandIn();
  const [file, setFile] = useState<File | null>(null);
  const [name, setName] = useState("");
  const { mutate, reset } = look;
  useEffect(() => {
    reset();
    if (file !== null) mutate({ file, season: season.name, track });
  }, [file, season.name, track, mutate, reset]);
  return (
    <Section title="Hand in a package">
      <Stack gap="sm">
        <DropZone
          icon={<IconFileZip size={32} aria-hidden />}
          title="Drop a ZIP file with the package's files here"
          hint="It is checked first; nothing is kept before you hand it in."
          label="Package"
          accept=".zip,application/zip"
          busy={look.isPending}
          onFile={setFile}
        />
        {look.isError && <ProblemNote error={look.error} />}
        {look.data !== undefined && file !== null && (
          <>
            <Alert
              color={look.data.passed ? "teal" : "red"}
              title={look.data.passed ? "✓ every rule is kept" : "✗ a rule is broken"}
            >
              {look.data.passed ? `${file.name} can be handed in.` : look.data.reason}
            </Alert>
            <Findings report={look.data.report as unknown as Report} />
            <form
              onSubmit={(event) => {
                event.preventDefault();
                handIn.mutate({ file, season: season.name, track, name });
              }}
            >
              <Group align="end">
                <TextInput
                  label="Name of the entry"
                  value={name}
                  maxLength={80}
                  required
                  onChange={(event) => {
                    setName(event.currentTarget.value);
                  }}
                />
                <Button type="submit" disabled={!isOpen || !look.data.passed} loading={handIn.isPending}>
                  Hand in
                </Button>
              </Group>
            </form>
            {!isOpen && <Text size="sm">The season takes no packages now.</Text>}
          </>
        )}
        {handIn.isError && <ProblemNote error={handIn.error} />}
        {handIn.data !== undefined && (
          <Text size="sm" role="status">
            {handIn.data.added ? "Handed in" : "It was there before; nothing changed"}: {handIn.data.id}
          </Text>
        )}
      </Stack>
    </Section>
  );
}
