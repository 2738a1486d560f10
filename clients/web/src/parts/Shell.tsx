import {
  ActionIcon,
  Anchor,
  Box,
  Container,
  Group,
  Popover,
  Text,
  Title,
  useComputedColorScheme,
  useMantineColorScheme,
} from "@mantine/core";
import { IconKey, IconMoon, IconSun } from "@tabler/icons-react";
import { Link, Outlet, useRouterState } from "@tanstack/react-router";
import { useEffect } from "react";
import { siteFile, isSite } from "../api/site";
import { KeyField, useKey } from "./KeyField";
import { ProblemNote } from "./Problem";
import { SiteNote } from "./SiteNote";

const PLACES = [
  { to: "/", label: "Leaderboard" },
  { to: "/tasks", label: "Tasks" },
  { to: "/sweeps", label: "Runs" },
  { to: "/build", label: "Build" },
  { to: "/method", label: "Method" },
] as const;

/** Links to pages; a published site has no workbench. */
const places = PLACES.filter(({ to }) => !isSite || to !== "/build");

/** The frame of every page: where one is, where one can go, light or dark, the key. */
export function Shell() {
  const path = useRouterState({ select: (state) => state.location.pathname });
  useEffect(() => {
    // A job's page has a title in words.
    if (path.startsWith("/jobs/")) return;
    const name = path
      .split("/")
      .filter((part) => part !== "")
      .join(" · ");
    document.title = name === "" ? "BuildArena" : `${name} – BuildArena`;
  }, [path]);
  return (
    <>
      <a
        className="skip-link"
        href="#main"
        onClick={(event) => {
          // Behind its # a published site has the address of the page.
          event.preventDefault();
          document.getElementById("main")?.focus();
        }}
      >
        Skip to the content
      </a>
      <Box
        component="header"
        style={{ borderBottom: "1px solid var(--mantine-color-default-border)" }}
        bg="var(--mantine-color-body)"
      >
        <Container size="var(--page-width)" py={10}>
          <Group justify="space-between" gap="xs">
            <Group gap="md" className="site-places">
              <Link className="quiet" to="/" aria-label="BuildArena, start">
                <Group gap={8} wrap="nowrap">
                  <img src={siteFile("favicon.svg")} width={24} height={24} alt="" />
                  <Text fw={700}>BuildArena</Text>
                </Group>
              </Link>
              <Group component="nav" gap="sm" aria-label="Pages" className="site-nav">
                {places.map(({ to, label }) => (
                  <Anchor
                    key={to}
                    component={Link}
                    to={to}
                    size="sm"
                    c="inherit"
                    activeOptions={{ exact: to === "/", includeSearch: false }}
                    activeProps={{ style: { fontWeight: 700, textDecoration: "underline", textUnderlineOffset: 6 } }}
                  >
                    {label}
                  </Anchor>
                ))}
              </Group>
            </Group>
            <Group gap={6}>
              {!isSite && <KeyButton />}
              <SchemeButton />
            </Group>
          </Group>
        </Container>
      </Box>
      <Container component="main" id="main" tabIndex={-1} size="var(--page-width)" py="lg" style={{ outline: "none" }}>
        <Outlet />
      </Container>
      {isSite ? (
        <SiteNote />
      ) : (
        <Container component="footer" size="var(--page-width)" py="lg">
          <Anchor href={siteFile("docs")} size="sm" c="inherit">
            API documentation
          </Anchor>
        </Container>
      )}
    </>
  );
}

function KeyButton() {
  const known = useKey();
  return (
    <Popover position="bottom-end" withArrow trapFocus>
      <Popover.Target>
        <ActionIcon
          variant={known === null ? "subtle" : "light"}
          color="gray"
          c="inherit"
          aria-label={known === null ? "Give an API key" : "API key is set"}
        >
          <IconKey size={18} aria-hidden />
        </ActionIcon>
      </Popover.Target>
      <Popover.Dropdown>
        <KeyField />
      </Popover.Dropdown>
    </Popover>
  );
}

function SchemeButton() {
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme("light", { getInitialValueInEffect: false });
  const other = scheme === "dark" ? "light" : "dark";
  return (
    <ActionIcon
      variant="subtle"
      color="gray"
      c="inherit"
      aria-label={`Use the ${other} colours`}
      onClick={() => setColorScheme(other)}
    >
      {scheme === "dark" ? <IconSun size={18} aria-hidden /> : <IconMoon size={18} aria-hidden />}
    </ActionIcon>
  );
}

export function Missing() {
  return (
    <>
      <Title order={1}>Not found</Title>
      <Text mt="sm">
        <Link to="/">The leaderboard</Link>, <Link to="/jobs">all jobs</Link>, <Link to="/tasks">all tasks</Link>
      </Text>
    </>
  );
}

/** What a published site says in place of a page that needs a running service. */
export function NeedsService() {
  return (
    <>
      <Title order={1}>Not part of the published site</Title>
      <Text mt="sm">
        Building and starting runs need a running service. <Link to="/">The leaderboard</Link>,{" "}
        <Link to="/jobs">all jobs</Link>, <Link to="/tasks">all tasks</Link>
      </Text>
    </>
  );
}

export function RootError({ error, reset }: { error: unknown; reset: () => void }) {
  return <ProblemNote error={error} retry={reset} />;
}
