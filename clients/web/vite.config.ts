import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../../engine/sketchmatch/server/pad",
    emptyOutDir: true,
    target: "es2022",
    // A page that may load nothing inline has its pictures as files.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  server: { proxy: { "/sketchmatch.": "http://127.0.0.1:8080" } },
});
