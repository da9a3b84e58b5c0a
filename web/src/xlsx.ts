// A table as a workbook of one sheet (ECMA-376, ISO/IEC 29500-1), in a ZIP file without compression.

const HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n';
const MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
const LINKS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
const PACKAGE = "http://schemas.openxmlformats.org/package/2006";
const SHEET = "application/vnd.openxmlformats-officedocument.spreadsheetml";
export const XLSX_TYPE = `${SHEET}.sheet`;
/** 1 January 1980, the first day that a ZIP file can state: the same table gives the same file. */
const DAY = 0x21;

const escaped = (text: string): string =>
  text.replace(/[\u0000-\u0008\u000b\u000c\u000e-\u001f\ufffe\uffff]/g, "").replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

/** The number that a whole text is; null for others, which stay as they are shown. */
function wholeNumber(text: string): number | null {
  const plain = text.trim().replace(/−/g, "-").replace(/[\u2009\u202f\u00a0]/g, "");
  return /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(plain) && Number.isFinite(Number(plain)) ? Number(plain) : null;
}

const cell = (text: string): string => {
  const value = wholeNumber(text);
  return value === null ? `<c t="inlineStr"><is><t xml:space="preserve">${escaped(text)}</t></is></c>` : `<c><v>${value}</v></c>`;
};

/** Rows as a workbook: numbers as numbers, all else as text, and nothing as a formula. */
export function xlsx(rows: string[][]): Uint8Array<ArrayBuffer> {
  const sheet = rows.map((cells) => `<row>${cells.map(cell).join("")}</row>`).join("");
  const relation = (kind: string, target: string) =>
    `${HEAD}<Relationships xmlns="${PACKAGE}/relationships"><Relationship Id="rId1" Type="${LINKS}/${kind}" Target="${target}"/></Relationships>`;
  const part = (name: string, type: string) => `<Override PartName="/${name}" ContentType="${SHEET}.${type}+xml"/>`;
  return zip([
    ["[Content_Types].xml", `${HEAD}<Types xmlns="${PACKAGE}/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>${part("xl/workbook.xml", "sheet.main")}${part("xl/worksheets/sheet1.xml", "worksheet")}</Types>`],
    ["_rels/.rels", relation("officeDocument", "xl/workbook.xml")],
    ["xl/workbook.xml", `${HEAD}<workbook xmlns="${MAIN}" xmlns:r="${LINKS}"><sheets><sheet name="Table" sheetId="1" r:id="rId1"/></sheets></workbook>`],
    ["xl/_rels/workbook.xml.rels", relation("worksheet", "worksheets/sheet1.xml")],
    ["xl/worksheets/sheet1.xml", `${HEAD}<worksheet xmlns="${MAIN}"><sheetData>${sheet}</sheetData></worksheet>`],
  ]);
}

/** Files in a ZIP file, stored. */
export function zip(files: [string, string | Uint8Array][]): Uint8Array<ArrayBuffer> {
  const local: Uint8Array[] = [], central: Uint8Array[] = [];
  let at = 0;
  for (const [path, content] of files) {
    const name = new TextEncoder().encode(path), data = typeof content === "string" ? new TextEncoder().encode(content) : content;
    // version 2.0, names in UTF-8, stored, time 0, day, checksum, both sizes, lengths of the name and of further fields
    const facts: [number, number][] = [[2, 20], [2, 0x800], [2, 0], [2, 0], [2, DAY], [4, crc32(data)], [4, data.length], [4, data.length], [2, name.length], [2, 0]];
    local.push(record([[4, 0x04034b50], ...facts]), name, data);
    central.push(record([[4, 0x02014b50], [2, 20], ...facts, [2, 0], [2, 0], [2, 0], [4, 0], [4, at]]), name);
    at += 30 + name.length + data.length;
  }
  const size = central.reduce((sum, b) => sum + b.length, 0);
  const end = record([[4, 0x06054b50], [2, 0], [2, 0], [2, files.length], [2, files.length], [4, size], [4, at], [2, 0]]);
  return joined([...local, ...central, end]);
}

/** Whole numbers of so many bytes, the lowest byte first. */
function record(fields: [number, number][]): Uint8Array {
  return Uint8Array.from(fields.flatMap(([bytes, value]) => Array.from({ length: bytes }, (_, k) => (value >>> (8 * k)) & 255)));
}

function joined(parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const out = new Uint8Array(parts.reduce((sum, b) => sum + b.length, 0));
  let at = 0;
  for (const part of parts) { out.set(part, at); at += part.length; }
  return out;
}

export function crc32(bytes: Uint8Array): number {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let k = 0; k < 8; k++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return ~sum >>> 0;
}
