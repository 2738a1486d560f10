import react from "@vitejs/plugin-react";
import { defineConfig } from "vite";
import { here, moduleShapes } from "./vite.config.ts";

/** What notebooks show machines and trials with: one script, which pages carry inside. */
export default defineConfig({
  plugins: [react(), moduleShapes],
  // Its pages embed it whole; nothing else is asked for.
  publicDir: false,
  build: {
    outDir: here("../cli/src/buildarena/viewer"),
    emptyOutDir: true,
    target: "es2022",
    chunkSizeWarningLimit: 1500,
    lib: { entry: here("src/viewer/main.tsx"), formats: ["iife"], name: "viewer", fileName: () => "viewer.js" },
  },
  define: { "process.env.NODE_ENV": '"production"' },
});
