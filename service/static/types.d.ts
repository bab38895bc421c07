/** Shapes that the modules of the page share; read by the type checker alone. */

/** JSON schema, or a part of it. */
type Schema = Record<string, any>;
/** What is wrong with the value at a JSON pointer. */
type Fault = { pointer: string; detail: string };
/** What is answered within the request. */
type Operation = { path: string; name: string; summary: string; description: string; input: Schema; output: Schema };

type Child = Node | string | number | null | undefined | false;
type Children = (Child | Child[])[];
/** Attributes; `on...` are listeners. */
type Props = Record<string, any>;
type Html = <K extends keyof HTMLElementTagNameMap>(
  tag: K, props?: Props, ...children: Children) => HTMLElementTagNameMap[K];

/** Part of a form; what was left open reads as undefined. */
type Widget = { node: HTMLElement; read: () => any };
type Builder = (form: import("./form.js").Form, s: Schema, value: any, pointer: string) => Widget;

/** What a view is given; `keep` minds work that goes on after the view stands there. */
type View = {
  main: HTMLElement; signal: AbortSignal; go: (hash: string) => void; keep: (work: Promise<any>) => void };

/** Figures as the service makes them, without a template, and why others are lacking. */
type Figures = {
  templates: { light: any; dark: any }; figures: Record<string, { data: any[]; layout: any }>;
  omitted: Record<string, string> };
