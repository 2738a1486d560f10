import "@mantine/core/styles.css";
import "@mantine/notifications/styles.css";
import "./style.css";
import { MantineProvider } from "@mantine/core";
import { Notifications } from "@mantine/notifications";
import { QueryClientProvider } from "@tanstack/react-query";
import { RouterProvider } from "@tanstack/react-router";
import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { queries } from "./api/cache";
import { wakeWithService } from "./api/waking";
import { fetchWhenIdle, router } from "./router";
import { theme } from "./theme";

/** A page whose script is there by then is painted together with its frame; else the frame comes first. */
const SOON_MS = 150;

wakeWithService(queries);
fetchWhenIdle();
await Promise.race([router.load(), new Promise((resolve) => setTimeout(resolve, SOON_MS))]);

const root = document.getElementById("root");
if (root !== null) {
  createRoot(root).render(
    <StrictMode>
      <MantineProvider theme={theme} defaultColorScheme="auto">
        <Notifications position="bottom-right" />
        <QueryClientProvider client={queries}>
          <RouterProvider router={router} />
        </QueryClientProvider>
      </MantineProvider>
    </StrictMode>,
  );
}
