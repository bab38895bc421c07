/** The service's OpenAPI document: the one place of fields, units, bounds and help. */

import { request } from "./api.js";

/** @type {any} */
let openapi;

export async function loadSchema() {
  openapi ??= await request("GET", "/openapi.json");
}

/** Whether a body can be sent there. @param {string} path */
export const exists = (path) => Boolean(openapi.paths[path]?.post);

/** @param {string} path @returns {Operation} */
export function operation(path) {
  const { summary, description, requestBody, responses } = openapi.paths[path].post;
  const schemaOf = (part) => part?.content?.["application/json"]?.schema ?? {};
  const name = path.split("/").at(-1) ?? "";
  return { path, name, summary, description, input: schemaOf(requestBody), output: schemaOf(responses["200"]) };
}

/** What is answered within the request, and asked for by a form. */
export const analyses = () =>
  Object.keys(openapi.paths)
    .filter((path) => /^\/v1\/[^/]+$/.test(path) && openapi.paths[path].post?.tags.includes("analyses"))
    .map(operation)
    .filter(({ input }) => resolve(input)["x-form"] !== false);

/**
 * Follow references and fold unions: `nullable` says that null is permitted, `variants` lists
 * the other forms where there are several.
 * @param {Schema} schema @returns {Schema}
 */
export function resolve(schema) {
  const { $ref, anyOf, oneOf, ...own } = schema;
  if ($ref) return { ...resolve(openapi.components.schemas[$ref.split("/").at(-1)]), ...own };
  const forms = anyOf ?? oneOf;
  if (!forms) return own;
  const others = forms.filter((/** @type {Schema} */ form) => form.type !== "null");
  const nullable = others.length < forms.length;
  if (others.length > 1) return { ...own, nullable, variants: others.map(resolve) };
  return { ...resolve(others[0]), ...own, nullable };
}

/**
 * The form of a union that a value has: that of its tag, else the first that knows its fields.
 * @param {Schema[]} variants @param {any} value @returns {Schema}
 */
export function variantOf(variants, value) {
  if (Array.isArray(value)) return variants.find(({ type }) => type === "array") ?? variants[0];
  if (typeof value !== "object") return variants.find((one) => one.const === value) ?? variants[0];
  const keys = Object.keys(value ?? {});
  const fits = (/** @type {Schema} */ variant) =>
    keys.every((key) => {
      const property = variant.properties?.[key];
      return property && (!("const" in property) || property.const === value[key]);
    });
  return variants.find(fits) ?? variants[0];
}

/** The parts of `given` that the schema has a place for. @param {any} schema @param {any} given */
export function fitting(schema, given) {
  const known = resolve(schema).properties;
  return Object.fromEntries(Object.entries(given).filter(([key]) => key in known));
}

/**
 * A value to begin with: the default, else an example.
 * @param {Schema} schema @param {boolean} [examples] false: leave open what has no default @returns {any}
 */
export function initial(schema, examples = true) {
  const s = resolve(schema);
  if ("const" in s) return s.const;
  if (s.default !== undefined && s.type !== "object") return s.default;
  if (s.nullable && !("default" in s)) return null;
  const example = s.examples?.find((/** @type {any} */ one) => one !== null);
  const form = s.variants ? s.variants[0] : s;
  if (form.type === "object") {
    if (examples && example) return example;
    const entries = Object.entries(form.properties ?? {});
    return Object.fromEntries(entries.map(([key, part]) => [key, initial(part, examples)]));
  }
  return examples ? example : undefined;
}

/**
 * Where a value does not match its schema, in words for the person who typed it.
 * @param {Schema} schema @param {any} value @param {string} [pointer] @returns {Fault[]}
 */
export function faults(schema, value, pointer = "") {
  let s = resolve(schema);
  if (s.nullable && value === null) return [];
  if (s.variants) s = variantOf(s.variants, value);
  const wrong = (detail) => [{ pointer, detail }];
  if (value === undefined || value === null) return wrong("This is needed.");
  if ("const" in s) return value === s.const ? [] : wrong(`This must be ${s.const}.`);
  if (s.enum) return s.enum.includes(value) ? [] : wrong(`One of ${s.enum.join(", ")}.`);
  switch (s.type) {
    case "object": {
      const properties = s.properties ?? {};
      const required = s.required ?? [];
      const keys = new Set([...Object.keys(value), ...required]);
      return [...keys].flatMap((key) => {
        if (properties[key]) return faults(properties[key], value[key], `${pointer}/${key}`);
        return s.additionalProperties === false ? wrong(`There is no field ${key}.`) : [];
      });
    }
    case "array": {
      if (!Array.isArray(value)) return wrong("A list is needed.");
      if (value.length < (s.minItems ?? 0)) return wrong(`At least ${s.minItems} of these.`);
      if (value.length > (s.maxItems ?? Infinity)) return wrong(`At most ${s.maxItems} of these.`);
      return value.flatMap((item, i) => faults(s.prefixItems?.[i] ?? s.items ?? {}, item, `${pointer}/${i}`));
    }
    case "integer":
    case "number": {
      if (typeof value !== "number") return wrong("Enter a number.");
      if (s.type === "integer" && !Number.isInteger(value)) return wrong("Enter a whole number.");
      if (value < s.minimum) return wrong(`At least ${s.minimum + (s["x-index"] ? 1 : 0)}.`);
      if (value <= s.exclusiveMinimum) return wrong(`More than ${s.exclusiveMinimum}.`);
      if (value > s.maximum) return wrong(`At most ${s.maximum}.`);
      if (value >= s.exclusiveMaximum) return wrong(`Less than ${s.exclusiveMaximum}.`);
      return [];
    }
    case "boolean":
      return typeof value === "boolean" ? [] : wrong("Yes or no.");
    case "string":
      return typeof value === "string" ? [] : wrong("Enter text.");
  }
  return [];
}
