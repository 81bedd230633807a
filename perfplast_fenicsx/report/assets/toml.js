// Case files: TOML text as tables with the positions of their values, so that edits keep comments.

class CaseFault extends Error {
  constructor(words, line) {
    super(words);
    this.line = line;
  }
}

const NUMBER = /^[+-]?(?:\d[\d_]*)(?:\.\d[\d_]*)?(?:[eE][+-]?\d+)?/;
const ESCAPES = { b: "\b", t: "\t", n: "\n", f: "\f", r: "\r", '"': '"', "\\": "\\" };

/** Read one value or a whole file. Throws CaseFault with the line. */
class TomlReader {
  constructor(text) {
    Object.assign(this, { text, at: 0 });
  }

  fail(words) {
    throw new CaseFault(words, this.text.slice(0, this.at).split("\n").length);
  }

  peek(length = 1) { return this.text.substr(this.at, length); }

  take(token) {
    if (this.peek(token.length) !== token) this.fail(`'${token}' is missing before '${this.rest}'`);
    this.at += token.length;
  }

  get rest() { return this.text.slice(this.at).split("\n")[0].slice(0, 30) || "the end of the line"; }

  spaces() { while (/[ \t]/.test(this.peek())) this.at++; }

  /** Skip blanks, line ends and comments. */
  blanks() {
    for (;;) {
      while (/\s/.test(this.peek())) this.at++;
      if (this.peek() !== "#") return;
      while (this.at < this.text.length && this.peek() !== "\n") this.at++;
    }
  }

  /** Skip blanks and a comment after a value in its line. */
  endOfLine() {
    this.spaces();
    if (this.peek() === "#") while (this.at < this.text.length && this.peek() !== "\n") this.at++;
    if (this.peek() === "\r") this.at++;
    if (this.at < this.text.length) {
      if (this.peek() !== "\n") this.fail(`'${this.rest}' is not expected in this line`);
      this.at++;
    }
  }

  key() {
    const names = [];
    do {
      if (names.length) this.at++;
      this.spaces();
      if (this.peek() === '"' || this.peek() === "'") {
        names.push(this.string());
      } else {
        const [name] = /^[\w-]*/.exec(this.text.slice(this.at, this.at + 200));
        if (!name) this.fail(`a name is missing before '${this.rest}'`);
        names.push(name);
        this.at += name.length;
      }
      this.spaces();
    } while (this.peek() === ".");
    return names;
  }

  string() {
    const quote = this.peek();
    const long = this.peek(3) === quote.repeat(3);
    const end = long ? quote.repeat(3) : quote;
    this.at += end.length;
    if (long && this.peek() === "\n") this.at++;
    let found = "";
    while (this.peek(end.length) !== end) {
      if (this.at >= this.text.length || (!long && this.peek() === "\n")) this.fail(`${quote} is missing at the end of a text`);
      if (quote === '"' && this.peek() === "\\") {
        const letter = this.text[this.at + 1];
        const digits = { u: 4, U: 8 }[letter];
        if (digits) {
          found += String.fromCodePoint(parseInt(this.text.substr(this.at + 2, digits), 16) || 0xfffd);
          this.at += 2 + digits;
        } else if (letter in ESCAPES) {
          found += ESCAPES[letter];
          this.at += 2;
        } else if (long && /\s/.test(letter)) {
          this.at++;
          while (/\s/.test(this.peek())) this.at++;
        } else {
          this.fail(`'\\${letter}' is not known in a text; write '\\\\' for a backslash`);
        }
      } else {
        found += this.text[this.at++];
      }
    }
    this.at += end.length;
    return found;
  }

  value() {
    const first = this.peek();
    if (first === '"' || first === "'") return this.string();
    if (first === "[") return this.list();
    if (first === "{") return this.inline();
    const [word] = /^[^\s,\]}#]*/.exec(this.text.slice(this.at, this.at + 200));
    if (word === "true" || word === "false") {
      this.at += word.length;
      return word === "true";
    }
    const signed = /^([+-]?)(inf|nan)$/.exec(word);
    const [digits] = NUMBER.exec(word) ?? [""];
    if (!word || (!signed && digits !== word)) {
      this.fail(`'${word || this.rest}' is not a value; texts need quotes, and numbers a point, as 1.5`);
    }
    this.at += word.length;
    if (signed) return signed[2] === "nan" ? NaN : (signed[1] === "-" ? -Infinity : Infinity);
    return Number(word.replaceAll("_", ""));
  }

  list() {
    const found = [];
    this.take("[");
    for (this.blanks(); this.peek() !== "]"; this.blanks()) {
      found.push(this.value());
      this.blanks();
      if (this.peek() !== "]") this.take(",");
    }
    this.at++;
    return found;
  }

  inline() {
    const found = {};
    this.take("{");
    for (this.spaces(); this.peek() !== "}"; this.spaces()) {
      const names = this.key();
      this.take("=");
      this.spaces();
      this.put(found, names, this.value());
      this.spaces();
      if (this.peek() !== "}") this.take(",");
    }
    this.at++;
    return found;
  }

  put(table, names, value) {
    for (const name of names.slice(0, -1)) table = this.inside(table, name);
    const last = names.at(-1);
    if (Object.hasOwn(table, last)) this.fail(`'${last}' is given twice`);
    table[last] = value;
  }

  inside(table, name) {
    if (!Object.hasOwn(table, name)) table[name] = {};
    const found = Array.isArray(table[name]) ? table[name].at(-1) : table[name];
    if (typeof found !== "object" || found === null) this.fail(`'${name}' is a value and a table`);
    return found;
  }

  /** The whole file: its value, and its tables with the places of header, end and values. */
  file() {
    const root = {};
    const tables = [{ path: [], list: false, start: 0, body: 0, end: 0, keys: {}, value: root }];
    const seen = new Set();
    for (this.blanks(); this.at < this.text.length; this.blanks()) {
      if (this.peek() === "[") {
        tables.push(this.header(root, seen));
        continue;
      }
      const table = tables.at(-1);
      const line = this.text.lastIndexOf("\n", this.at - 1) + 1;
      const names = this.key();
      this.take("=");
      this.spaces();
      const start = this.at;
      const value = this.value();
      const place = { line, start, end: this.at, dotted: names.length > 1 };
      this.put(table.value, names, value);
      this.endOfLine();
      table.keys[names[0]] ??= { ...place, after: this.at };
      table.end = this.at;
    }
    return { value: root, tables };
  }

  header(root, seen) {
    const start = this.text.lastIndexOf("\n", this.at - 1) + 1;
    const list = this.peek(2) === "[[";
    this.at += list ? 2 : 1;
    const path = this.key();
    this.take(list ? "]]" : "]");
    let table = root;
    for (const name of path.slice(0, -1)) table = this.inside(table, name);
    const last = path.at(-1);
    if (list) {
      if (!Object.hasOwn(table, last)) table[last] = [];
      if (!Array.isArray(table[last])) this.fail(`'${path.join(".")}' is a table and a list of tables`);
      table[last].push({});
    } else if (seen.has(path.join("\n")) || Array.isArray(table[last])) {
      this.fail(`[${path.join(".")}] is given twice`);
    }
    seen.add(path.join("\n"));
    const value = this.inside(table, last);
    this.endOfLine();
    const number = list ? table[last].length - 1 : null;
    return { path, list, number, start, body: this.at, end: this.at, keys: {}, value };
  }
}

const parseToml = (text) => new TomlReader(text.replaceAll("\r\n", "\n")).file();

/** One value alone, as in a field. */
function parseValue(text) {
  const reader = new TomlReader(text);
  reader.blanks();
  const value = reader.value();
  reader.blanks();
  if (reader.at < text.length) reader.fail(`'${reader.rest}' is not expected here`);
  return value;
}

const quoted = (text) => JSON.stringify(text).replaceAll("\x7f", "\\u007f");

const bare = (name) => (/^[\w-]+$/.test(name) ? name : quoted(name));

/** A value as TOML. */
function toToml(value) {
  if (typeof value === "string") return quoted(value);
  if (Array.isArray(value)) return `[${value.map(toToml).join(", ")}]`;
  if (typeof value === "object") {
    return `{ ${Object.entries(value).map(([key, one]) => `${bare(key)} = ${toToml(one)}`).join(", ")} }`;
  }
  return String(value);
}

/** The order in which new tables are written. */
const ORDER = [
  "title", "geometry", "material", "contact", "tie", "support", "load", "gravity", "model",
  "element", "loading", "mesh", "units",
];

const spliced = (text, from, to, put) => text.slice(0, from) + put + text.slice(to);

const ended = (text) => (text === "" || text.endsWith("\n") ? text : `${text}\n`);

/** The text with a new value in a table, as TOML; `# <-` beside the old value is removed. */
function withKey(text, table, key, toml) {
  const place = table.keys[key];
  if (place?.dotted) throw new CaseFault(`'${key}' has dots in the file; change it in the text`, 0);
  if (place) {
    const rest = text.slice(place.end, place.after).replace(/\s*# <-[^\n]*/, "");
    return spliced(text, place.start, place.after, toml + rest);
  }
  const before = ended(text.slice(0, table.end));
  return `${before}${bare(key)} = ${toml}\n${text.slice(table.end)}`;
}

/** What follows the values of a table in their lines, by key: a comment and the end of the line. */
const commentsOf = (text, table) => Object.fromEntries(Object.entries(table?.keys ?? {})
  .map(([key, { end, after }]) => [key, text.slice(end, after)]));

const withComment = (text, table, key, comment) =>
  spliced(text, table.keys[key].end, table.keys[key].after, comment);

const withoutKey = (text, table, key) =>
  spliced(text, table.keys[key].line, table.keys[key].after, "");

/** The text without a table, the comments right above it and a blank line. */
function withoutTable(text, table) {
  let from = table.start;
  for (;;) {
    const line = text.lastIndexOf("\n", from - 2) + 1;
    const above = text.slice(line, from);
    if (from === 0 || !above.startsWith("#") || above.startsWith("#:")) break;
    from = line;
  }
  if (from > 1 && text.slice(from - 2, from) === "\n\n") from -= 1;
  return spliced(text, from, table.end, "");
}

/** The text with a new table after those of its kind, or before those that follow it. */
function withTable(text, path, list, entries) {
  const { tables } = parseToml(text);
  const name = path.map(bare).join(".");
  const lines = Object.entries(entries).map(([key, toml]) => `${bare(key)} = ${toml}\n`).join("");
  const block = `${list ? `[[${name}]]` : `[${name}]`}\n${lines}`;
  const rank = (table) => ORDER.indexOf(table.path[0]);
  const before = tables.findLast((table) => table.path[0] === path[0])
    ?? tables.filter((table) => table.path.length && rank(table) < ORDER.indexOf(path[0]))
      .reduce((best, table) => (rank(table) >= rank(best) ? table : best), tables[0]);
  const [comments] = /^(#[^\n]*\n)*(?=\n|$)|/.exec(text.slice(before.end)); // of the table before
  const end = before.end + comments.length;
  const head = ended(text.slice(0, end));
  const rest = text.slice(end);
  return `${head}${head ? "\n" : ""}${block}${rest === "" || rest.startsWith("\n") ? "" : "\n"}${rest}`;
}
