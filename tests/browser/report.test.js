// The report in a real browser: node --test tests/browser
import assert from "node:assert/strict";
import { mkdirSync, statSync } from "node:fs";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

import { browser, temporaryFolder, sessions } from "./sessions.js";

const pages = sessions(temporaryFolder());
let chrome;

before(async () => {
  chrome = await chromium.launch({ executablePath: browser(), args: ["--no-sandbox"] });
});
after(async () => chrome?.close());

/// Opens a report, and tells what went wrong on the way and whatever it asked a network for.
async function open(name, { width = 1280, dark = false } = {}) {
  const context = await chrome.newContext({
    viewport: { width, height: 900 },
    colorScheme: dark ? "dark" : "light",
    permissions: ["clipboard-read", "clipboard-write"],
  });
  const page = await context.newPage();
  const wrong = [];
  page.on("console", (message) => wrong.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => wrong.push(String(error)));
  page.on("request", (request) => {
    if (!request.url().startsWith("file:")) wrong.push(`asked for ${request.url()}`);
  });
  await page.goto(pathToFileURL(pages[name]).href);
  return { page, wrong, close: () => context.close() };
}

for (const name of Object.keys(pages)) {
  describe(`the report of the session "${name}"`, () => {
    test("opens without an error and asks no network for anything", async () => {
      const { page, wrong, close } = await open(name);
      assert.ok((await page.locator("section").count()) >= 8);
      assert.equal(await page.locator("section").first().getAttribute("id"), "verdict");
      assert.deepEqual(wrong, []);
      await close();
    });

    test("is smaller than 3 MB", () => {
      assert.ok(statSync(pages[name]).size < 3e6, `${statSync(pages[name]).size} bytes`);
    });

    for (const width of [1280, 400]) {
      test(`fits into ${width} pixels, and all its words are inside their figures`, async () => {
        const { page, close } = await open(name, { width });
        assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), width);
        const outside = await page.evaluate(() => {
          const visible = (element) => element.checkVisibility();
          const panels = [...document.querySelectorAll("figure svg.panel")].filter(visible);
          const words = panels.flatMap((panel) => [...panel.querySelectorAll("text")].map((text) => [panel, text]));
          return words
            .filter(([panel, text]) => {
              const [a, b] = [panel.getBoundingClientRect(), text.getBoundingClientRect()];
              return b.left < a.left - 1 || b.right > a.right + 1 || b.top < a.top - 1 || b.bottom > a.bottom + 1;
            })
            .map(([panel, text]) => `${panel.getAttribute("aria-label")}: ${text.textContent}`);
        });
        assert.deepEqual(outside, []);
        const cut = await page.evaluate(() =>
          [...document.querySelectorAll(".scroll, pre, dd, td, li, p")]
            .filter((element) => element.checkVisibility() && element.scrollWidth > element.clientWidth + 1)
            .map((element) => element.textContent.slice(0, 60)),
        );
        assert.deepEqual(cut, []);
        await close();
      });
    }

    test("draws something in every panel of every figure, and no number that is none", async () => {
      const { page, close } = await open(name);
      const empty = await page.evaluate(() =>
        [...document.querySelectorAll("figure svg.panel")]
          .filter((panel) => {
            const drawn = panel.querySelectorAll(".plot .line, .plot .dot, .plot .bar, .cell");
            const paths = [...drawn].filter((shape) => shape.tagName !== "path" || shape.getAttribute("d").length > 4);
            return paths.length === 0 || /NaN|inf/.test(panel.innerHTML);
          })
          .map((panel) => panel.getAttribute("aria-label")),
      );
      assert.deepEqual(empty, []);
      await close();
    });
  });
}

test("the picker shows one trial at a time, by list and by button", async () => {
  const { page, close } = await open("paper");
  const shown = () => page.locator(".trial:visible figure").evaluateAll((all) => all.map((figure) => figure.id));
  const names = await page.locator("#trial option").evaluateAll((all) => all.map((option) => option.value));
  assert.equal(names.length, 36);
  assert.deepEqual(await shown(), [names[0]]);
  await page.selectOption("#trial", names[20]);
  assert.deepEqual(await shown(), [names[20]]);
  await page.click("[data-step='1']");
  assert.deepEqual(await shown(), [names[21]]);
  await page.selectOption("#trial", names[0]);
  await page.click("[data-step='-1']");
  assert.deepEqual(await shown(), [names[35]]);
  assert.ok((await page.locator(".trial:visible svg .line").count()) > 8);
  await close();
});

test("a table is copied with tabs, its deviations in columns of their own", async () => {
  const { page, close } = await open("paper");
  const table = page.locator(".table", { hasText: "By condition: mean over repetitions" });
  await table.locator(".copy").click();
  const rows = (await page.evaluate(() => navigator.clipboard.readText())).split("\n").map((row) => row.split("\t"));
  assert.equal(rows.length, 13);
  assert.deepEqual([...new Set(rows.map((row) => row.length))], [20]);
  assert.equal(rows[0][3], "± I_j (g m²)");
  const isNumber = (cell) => Number.isFinite(Number(cell)) && cell !== "";
  // What follows from the parameters (k_after, x_t, VAF) has no standard error.
  for (const row of rows.slice(1)) {
    assert.ok(row.slice(2, 14).every(isNumber));
    assert.ok([14, 16, 18].every((column) => isNumber(row[column])));
  }
  await close();
});

test("the diagnosis is shown with its cause, its gain and both residual maps", async () => {
  const { page, close } = await open("diagnosed");
  const words = await page.locator("#diagnosis").innerText();
  for (const part of ["named", "channel_skew", "delay 0.810 ms [0.750, 0.880]", "0.41 [0.36, 0.47]", "0.9810", "0.9960"]) {
    assert.ok(words.includes(part), `${part} is not in: ${words}`);
  }
  assert.equal(await page.locator("#residual-map svg.panel").count(), 2);
  assert.ok(!words.includes("does not say"));
  await close();
});

test("a session without a fit says so, and is drawn all the same", async () => {
  const { page, close } = await open("bare");
  const words = await page.locator("body").innerText();
  for (const part of ["There is no fit yet", "There is no diagnosis yet", "no protocol.json"]) {
    assert.ok(words.includes(part), `${part} is not in the page`);
  }
  assert.equal(await page.locator("#trial option").count(), 36);
  await close();
});

test("the colours follow the reader's light or dark page", async () => {
  const colours = [];
  for (const dark of [false, true]) {
    const { page, close } = await open("paper", { dark });
    colours.push(await page.evaluate(() => getComputedStyle(document.body).backgroundColor));
    await close();
  }
  assert.deepEqual(colours, ["rgb(255, 255, 255)", "rgb(20, 23, 26)"]);
});

// To look at the pages: SCREENSHOTS=DIR node --test tests/browser
test("pictures of every section", { skip: !process.env.SCREENSHOTS }, async () => {
  const folder = process.env.SCREENSHOTS;
  mkdirSync(folder, { recursive: true });
  for (const name of Object.keys(pages)) {
    for (const [width, dark] of [[1280, false], [400, false], [1280, true], [400, true]]) {
      const { page, close } = await open(name, { width, dark });
      for (const section of await page.locator("section").all()) {
        const id = await section.getAttribute("id");
        await section.screenshot({ path: join(folder, `${name}-${id}-${width}${dark ? "-dark" : ""}.png`) });
      }
      if (width === 1280 && !dark) await page.pdf({ path: join(folder, `${name}.pdf`), format: "A4" });
      await close();
    }
  }
});
