import {
  createHashHistory,
  createRootRoute,
  createRoute,
  createRouter,
  lazyRouteComponent,
} from "@tanstack/react-router";
import { noop } from "@tanstack/react-query";
import { queries } from "./api/cache";
import { board as boardOf, tasks as tasksOf } from "./api/queries";
import { BASE, isSite } from "./api/site";
import { readSearch } from "./api/board-search";
import BoardPage from "./pages/board/BoardPage";
import { readBuildSearch } from "./pages/workbench/search";
import { readCompareSearch } from "./pages/compare/search";
import { readJobSearch, readJobsSearch } from "./api/jobs-search";
import { Missing, NeedsService, RootError, Shell } from "./parts/Shell";

function readTrack(raw: Record<string, unknown>): { track?: string } {
  return { track: typeof raw.track === "string" && raw.track !== "" ? raw.track : undefined };
}

const root = createRootRoute({ component: Shell, notFoundComponent: Missing, errorComponent: RootError });

const board = createRoute({
  getParentRoute: () => root,
  path: "/",
  validateSearch: readSearch,
  // What changes the board itself: how it is shown asks for nothing.
  loaderDeps: ({ search: { track, task, category } }) => ({ track, task, category }),
  // Asked for while the page's script is on its way; the page reports what fails and asks again.
  loader: ({ deps }) => {
    queries.query(boardOf(deps)).catch(noop);
    queries.query(tasksOf()).catch(noop);
  },
  // The page that most visits begin with: no second round of scripts.
  component: BoardPage,
});
const sweeps = createRoute({
  getParentRoute: () => root,
  path: "/sweeps",
  component: lazyRouteComponent(() => import("./pages/sweeps/SweepsPage")),
});
const sweep = createRoute({
  getParentRoute: () => root,
  path: "/sweeps/$id",
  component: lazyRouteComponent(() => import("./pages/sweeps/SweepPage")),
});
const newSweep = createRoute({
  getParentRoute: () => root,
  path: "/sweeps/new",
  component: isSite ? NeedsService : lazyRouteComponent(() => import("./pages/sweeps/NewSweepPage")),
});
const jobs = createRoute({
  getParentRoute: () => root,
  path: "/jobs",
  validateSearch: readJobsSearch,
  component: lazyRouteComponent(() => import("./pages/jobs/JobsPage")),
});
const job = createRoute({
  getParentRoute: () => root,
  path: "/jobs/$id",
  validateSearch: readJobSearch,
  component: lazyRouteComponent(() => import("./pages/job/JobPage")),
});
const compare = createRoute({
  getParentRoute: () => root,
  path: "/compare",
  validateSearch: readCompareSearch,
  component: lazyRouteComponent(() => import("./pages/compare/ComparePage")),
});
const tasks = createRoute({
  getParentRoute: () => root,
  path: "/tasks",
  component: lazyRouteComponent(() => import("./pages/tasks/TasksPage")),
});
const task = createRoute({
  getParentRoute: () => root,
  path: "/tasks/$name",
  validateSearch: readTrack,
  component: lazyRouteComponent(() => import("./pages/tasks/TaskPage")),
});
const model = createRoute({
  getParentRoute: () => root,
  path: "/models/$",
  validateSearch: readTrack,
  component: lazyRouteComponent(() => import("./pages/models/ModelPage")),
});

const method = createRoute({
  getParentRoute: () => root,
  path: "/method",
  component: lazyRouteComponent(() => import("./pages/MethodPage")),
});
const build = createRoute({
  getParentRoute: () => root,
  path: "/build",
  validateSearch: readBuildSearch,
  component: isSite ? NeedsService : lazyRouteComponent(() => import("./pages/workbench/BuildPage")),
});

export const makeRouter = () =>
  createRouter({
    routeTree: root.addChildren([
      board,
      sweeps,
      newSweep,
      sweep,
      jobs,
      job,
      compare,
      tasks,
      task,
      model,
      method,
      build,
    ]),
    // A file server knows one page only, so the rest of the address is behind its #.
    history: isSite ? createHashHistory() : undefined,
    basepath: BASE === "" ? "/" : BASE,
    defaultPreload: "intent",
    scrollRestoration: true,
  });
type Router = ReturnType<typeof makeRouter>;

/** A page's script that is not there yet. */
interface Loaded {
  preload?: () => Promise<unknown>;
}

/** Fetches the scripts of all pages when there is nothing else to do: no click waits for the service then. */
export function fetchWhenIdle(router: Router): void {
  const pages = Object.values(router.routesById).map(({ options }) => options.component as Loaded | undefined);
  const whenIdle = (): unknown => ("requestIdleCallback" in window ? requestIdleCallback(next) : setTimeout(next, 50));
  const next = (): void => {
    const page = pages.shift();
    // One that fails is asked for again by whoever goes there.
    if (page !== undefined) (page.preload?.() ?? Promise.resolve()).then(whenIdle, whenIdle);
  };
  setTimeout(whenIdle, 1_500);
}

declare module "@tanstack/react-router" {
  interface Register {
    router: Router;
  }
}
