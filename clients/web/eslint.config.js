import js from "@eslint/js";
import imports from "eslint-plugin-import";
import hooks from "eslint-plugin-react-hooks";
import tseslint from "typescript-eslint";

export default tseslint.config(
  { ignores: ["src/api/contract.ts", "node_modules", "**/*.cjs"] },
  js.configs.recommended,
  {
    files: ["src/**/*.{ts,tsx}", "e2e/**/*.ts"],
    extends: [tseslint.configs.strictTypeChecked],
    plugins: { "react-hooks": hooks, import: imports },
    settings: {
      "import/resolver": { node: { extensions: [".ts", ".tsx"] } },
      "import/parsers": { "@typescript-eslint/parser": [".ts", ".tsx"] },
    },
    languageOptions: { parserOptions: { projectService: true } },
    rules: {
      ...hooks.configs.recommended.rules,
      // The compiler is not used, and virtual lists are never memoised.
      "react-hooks/incompatible-library": "off",
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-confusing-void-expression": "off",
      "max-lines": ["error", { max: 400, skipBlankLines: true }],
      "import/no-cycle": "error",
      // Pages use parts, parts use scenes, all use the API's client; nothing goes the other way round.
      "import/no-restricted-paths": [
        "error",
        {
          zones: [
            { target: "./src/api", from: ["./src/parts", "./src/scene", "./src/pages", "./src/viewer"] },
            { target: "./src/scene", from: ["./src/parts", "./src/pages", "./src/viewer"] },
            { target: "./src/parts", from: ["./src/pages", "./src/viewer"] },
            { target: "./src/viewer", from: "./src/pages" },
          ],
        },
      ],
      // What models and strangers wrote must never become markup.
      "no-restricted-syntax": [
        "error",
        { selector: "JSXAttribute[name.name='dangerouslySetInnerHTML']", message: "Text is text." },
      ],
      // The router throws redirects and not-found answers.
      "@typescript-eslint/only-throw-error": "off",
    },
  },
  {
    files: ["public/*.js", "scripts/*.mjs"],
    languageOptions: {
      globals: {
        localStorage: "readonly",
        matchMedia: "readonly",
        document: "readonly",
        process: "readonly",
        console: "readonly",
        URL: "readonly",
        fetch: "readonly",
        scrollTo: "readonly",
        scrollY: "readonly",
        performance: "readonly",
        PerformanceObserver: "readonly",
        requestAnimationFrame: "readonly",
        setTimeout: "readonly",
      },
    },
  },
);
