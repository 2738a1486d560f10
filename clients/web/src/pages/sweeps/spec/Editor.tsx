import {
  autocompletion,
  closeBrackets,
  completionKeymap,
  type CompletionContext,
  type CompletionResult,
} from "@codemirror/autocomplete";
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { yaml } from "@codemirror/lang-yaml";
import { bracketMatching, HighlightStyle, syntaxHighlighting } from "@codemirror/language";
import { lintGutter, setDiagnostics, type Diagnostic } from "@codemirror/lint";
import { EditorState } from "@codemirror/state";
import { EditorView, keymap, lineNumbers } from "@codemirror/view";
import { tags } from "@lezer/highlight";
import { useEffect, useRef } from "react";
import schema from "../../../../../../docs/sweep.schema.json";
import { suggestionsAt, type Known } from "./completion";
import type { Fault } from "./spec";

interface Editing {
  text: string;
  onText: (text: string) => void;
  faults: readonly Fault[];
  known: Known;
}

const LOOK = EditorView.theme({
  "&": {
    border: "1px solid var(--mantine-color-default-border)",
    borderRadius: "8px",
    fontSize: "13.5px",
    background: "var(--mantine-color-body)",
  },
  "&.cm-focused": { outline: "2px solid var(--mantine-primary-color-filled)" },
  ".cm-content": {
    fontFamily: "var(--mantine-font-family-monospace)",
    minHeight: "300px",
    caretColor: "var(--mantine-color-text)",
  },
  ".cm-gutters": { background: "transparent", color: "inherit", border: "none" },
  ".cm-tooltip": {
    background: "var(--mantine-color-body)",
    color: "var(--mantine-color-text)",
    border: "1px solid var(--mantine-color-default-border)",
  },
});

const COLOURS = HighlightStyle.define([
  { tag: [tags.propertyName, tags.definition(tags.propertyName)], color: "var(--code-key)", fontWeight: "600" },
  { tag: [tags.string, tags.content, tags.literal, tags.number, tags.bool], color: "var(--mantine-color-text)" },
  { tag: tags.comment, color: "var(--code-comment)", fontStyle: "italic" },
]);

function diagnostic(fault: Fault, length: number): Diagnostic {
  const choices = fault.choices.length > 0 ? ` (choose from ${fault.choices.join(", ")})` : "";
  const to = Math.min(length, fault.to);
  return { from: Math.min(fault.from, to), to, severity: "error", message: fault.message + choices };
}

/** An editor for a sweep's YAML, with completion and faults at their lines; Escape, then Tab, leaves it. */
export default function Editor({ text, onText, faults, known }: Editing) {
  const place = useRef<HTMLDivElement>(null);
  const view = useRef<EditorView | null>(null);
  const latest = useRef({ text, onText, known });
  useEffect(() => {
    latest.current = { text, onText, known };
  });

  useEffect(() => {
    if (place.current === null) return;
    const complete = (context: CompletionContext): CompletionResult | null => {
      const found = suggestionsAt(context.state.doc.toString(), context.pos, schema, latest.current.known);
      if (found === null || found.suggestions.length === 0 || (!context.explicit && found.from === context.pos))
        return null;
      return {
        from: found.from,
        options: found.suggestions.map(({ label, detail, isKey }) => ({
          label,
          info: detail === "" ? undefined : detail,
          apply: isKey ? `${label}: ` : label,
          type: isKey ? "property" : "constant",
        })),
        validFor: /^[\w./-]*$/,
      };
    };
    const made = new EditorView({
      parent: place.current,
      state: EditorState.create({
        doc: latest.current.text,
        extensions: [
          ...[
            lineNumbers(),
            lintGutter(),
            history(),
            bracketMatching(),
            closeBrackets(),
            yaml(),
            EditorView.lineWrapping,
            LOOK,
          ],
          syntaxHighlighting(COLOURS),
          autocompletion({ override: [complete] }),
          keymap.of([...completionKeymap, ...defaultKeymap, ...historyKeymap]),
          EditorView.contentAttributes.of({ "aria-label": "The sweep as YAML" }),
          EditorView.updateListener.of((update) => {
            if (update.docChanged) latest.current.onText(update.state.doc.toString());
          }),
        ],
      }),
    });
    view.current = made;
    return () => {
      made.destroy();
      view.current = null;
    };
  }, []);

  useEffect(() => {
    const editor = view.current;
    if (editor === null || editor.state.doc.toString() === text) return;
    editor.dispatch({ changes: { from: 0, to: editor.state.doc.length, insert: text } });
  }, [text]);

  useEffect(() => {
    const editor = view.current;
    if (editor === null) return;
    editor.dispatch(
      setDiagnostics(
        editor.state,
        faults.map((fault) => diagnostic(fault, editor.state.doc.length)),
      ),
    );
  }, [faults, text]);

  return <div ref={place} />;
}
