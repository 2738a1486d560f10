import "@mantine/core/styles.css";
import "@mantine/notifications/styles.css";
import "./style.css";
import { MantineProvider } from "@mantine/core";
import { Notifications } from "@mantine/notifications";
import { QueryClientProvider } from "@tanstack/react-query";
import { RouterProvider } from "@tanstack/react-router";
import { startTransition, StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { queries } from "./api/cache";
import { wakeWithService } from "./api/retry-on-focus";
import { fetchWhenIdle, makeRouter } from "./router";
import { theme } from "./theme";

wakeWithService(queries);

function show(root: HTMLElement): void {
  const router = makeRouter();
  // The page's figures are asked for while its frame is made; the page reports what fails.
  router.load().catch(console.error);
  fetchWhenIdle(router);
  // A transition, so that the browser answers while React renders.
  startTransition(() =>
    createRoot(root).render(
      <StrictMode>
        <MantineProvider theme={theme} defaultColorScheme="auto">
          <Notifications position="bottom-right" />
          <QueryClientProvider client={queries}>
            <RouterProvider router={router} />
          </QueryClientProvider>
        </MantineProvider>
      </StrictMode>,
    ),
  );
}

const root = document.getElementById("root");
// A task of its own, so that the browser answers after the scripts have been read.
if (root !== null) setTimeout(show, 0, root);
