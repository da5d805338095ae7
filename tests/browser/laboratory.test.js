// The console of a laboratory in a real browser: node --test tests/browser
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";

import { start, stopAll } from "./program.js";
import { browser, program as ramphold, temporaryFolder } from "./sessions.js";

const root = new URL("../..", import.meta.url).pathname;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const folder = temporaryFolder();
let chrome;

before(async () => {
  chrome = await chromium.launch({ executablePath: browser(), args: ["--no-sandbox"] });
});
after(async () => {
  stopAll();
  await chrome?.close();
});

/// A laboratory with two subjects and a protocol that is soon over.
function laboratory(name) {
  const own = join(folder, name);
  execFileSync(ramphold(), ["new", own, "--yes", "--quiet"], { stdio: "pipe" });
  const protocol = JSON.parse(readFileSync(join(root, "protocols/quick.json"), "utf8"));
  protocol.before = { offset_s: 0.3, mvc: { efforts: 1, duration_s: 0.5, rest_s: 0.3 }, familiarisation_trials: 0 };
  writeFileSync(join(own, "protocol.json"), JSON.stringify(protocol));
  writeFileSync(join(own, "subjects.csv"), "subject,hand,notes\nS01,left,\nS02,right,came by bicycle\n");
  return own;
}

async function open(url, { width = 1280, height = 800, dark = false } = {}) {
  const context = await chrome.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light" });
  context.setDefaultTimeout(90_000);
  const page = await context.newPage();
  const wrong = [];
  page.on("console", (message) => wrong.push(`${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => wrong.push(String(error)));
  await page.goto(url);
  return { page, wrong, close: () => context.close() };
}

let pictures = 0;
/// To look at the pages: SCREENSHOTS=DIR node --test tests/browser
async function picture(page, name) {
  if (!process.env.SCREENSHOTS) return;
  mkdirSync(process.env.SCREENSHOTS, { recursive: true });
  await page.screenshot({ path: join(process.env.SCREENSHOTS, `laboratory-${(pictures += 1)}-${name}.png`) });
}

const subject = "#choose-subject";
const begin = async (page) => {
  await page.locator("#begin:enabled").waitFor();
  await page.locator("#begin").click();
  await page.locator("#phase", { hasText: /^ready$/ }).waitFor();
};

test("two sessions are chosen, begun, run and left from one page, and nothing moves before the operator starts it", async () => {
  const program = await start(["console", laboratory("lab"), "--speed", "5"]);
  const operator = await open(program.operator);
  const looking = await open(program.subject);
  const { page } = operator;
  await page.locator("#checks li.open", { hasText: "choose a subject" }).waitFor();
  assert.ok(await page.locator("#begin").isDisabled());
  assert.equal(await page.locator("#controls").isVisible(), false);
  await picture(page, "open");
  await page.selectOption(subject, "S02");
  await page.locator("#begin:enabled").waitFor();
  assert.equal(await page.locator("#checks li.passed").count(), 5);
  await picture(page, "green");
  await begin(page);
  assert.equal(await page.locator("#title").textContent(), "S02 · a first look");
  assert.equal(await page.locator("#laboratory").isVisible(), false);
  await page.keyboard.press("s");
  await page.locator("#trial-rows tr.ok").first().waitFor();
  // The session stays in sight until the operator goes on; where its results are stands beside the button.
  await page.locator("#over", { hasText: /The session of S02 is over. Its results are in .*results$/ }).waitFor();
  assert.equal(await page.locator("#trial-rows tr.ok").count(), 8);
  assert.equal(await page.locator("#line").textContent(), "session over");
  await looking.page.locator('#display[aria-label="all trials are done"]').waitFor();
  await picture(page, "over");
  await page.keyboard.press("Enter");
  await page.locator("#sessions tr.state-fitted", { hasText: "S02" }).waitFor();
  const cells = await page.locator("#sessions tr.state-fitted td").allTextContents();
  assert.match(cells.slice(1).join(" "), /^– S02 8\/\d+ fitted$/);
  const wide = async (of) => (await page.locator(of).first().boundingBox()).x;
  assert.ok(Math.abs((await wide("#past-sessions th:nth-child(5)")) - (await wide("#sessions td:nth-child(5)"))) < 1, "columns are off their heads");
  assert.equal(await page.locator(subject).inputValue(), "");
  await picture(page, "back");
  await page.selectOption(subject, "S01");
  await begin(page);
  assert.match(await page.locator("#facts").textContent(), /left wrist/);
  // Nothing of the session before is left.
  assert.equal(await page.locator("#trial-rows tr.ok").count(), 0);
  assert.equal(await page.locator("#shown option").count(), 1);
  await page.keyboard.press("x");
  await page.keyboard.press("Enter");
  await page.locator("#over.alarm", { hasText: "ramphold resume" }).waitFor();
  // A page that is loaded anew begins with the lists.
  await page.reload();
  await page.locator("#notice.alarm", { hasText: "S01" }).waitFor();
  await page.locator("#sessions tr.state-unfinished", { hasText: "S01" }).waitFor();
  await picture(page, "unfinished");
  // It goes on by a click, waits for the operator again, and is run to its end.
  await page.getByRole("button", { name: /^resume protocol-S01-/ }).click();
  await page.locator("#phase", { hasText: /^ready$/ }).waitFor();
  assert.match(await page.locator("#facts").textContent(), /left wrist/);
  await page.keyboard.press("s");
  await page.locator("#over", { hasText: /The session of S01 is over. Its results are in .*results$/ }).waitFor();
  await page.keyboard.press("Enter");
  await page.locator("#sessions tr.state-fitted", { hasText: "S01" }).waitFor();
  assert.equal(await page.locator("#sessions button").count(), 0);
  assert.equal(await program.stop(), 0);
  await page.locator("#line", { hasText: "the program has ended" }).waitFor();
  assert.ok(await page.locator("#begin").isDisabled());
  assert.deepEqual([...operator.wrong, ...looking.wrong], []);
  await Promise.all([operator.close(), looking.close()]);
});

test("a check that fails says why, and turns green when its file is mended", async () => {
  const lab = laboratory("mended");
  const good = readFileSync(join(lab, "rig.json"), "utf8");
  writeFileSync(join(lab, "rig.json"), '{ "kind": "virtual", "emg": false }');
  const program = await start(["console", lab]);
  const { page, wrong, close } = await open(program.operator);
  await page.selectOption(subject, "S01");
  await page.locator("#checks li.failed", { hasText: "measures no EMG" }).waitFor();
  assert.ok(await page.locator("#begin").isDisabled());
  await picture(page, "failed");
  writeFileSync(join(lab, "rig.json"), good);
  await page.locator("#begin:enabled").waitFor();
  // The other page shows the same choice, and the list that is open here is not closed by it.
  const other = await open(program.operator);
  await other.page.selectOption(subject, "S02");
  await page.waitForFunction(() => document.getElementById("choose-subject").value === "S02");
  await program.stop();
  assert.deepEqual([...wrong, ...other.wrong], []);
  await Promise.all([close(), other.close()]);
});

for (const [width, height, dark] of [[1280, 800, false], [1920, 1080, true], [390, 844, false]]) {
  test(`axe finds nothing wrong at ${width} pixels, and everything fits`, async () => {
    const program = await start(["console", laboratory(`axe-${width}`)]);
    const { page, wrong, close } = await open(program.operator, { width, height, dark });
    await page.selectOption(subject, "S02");
    await page.locator("#begin:enabled").waitFor();
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => globalThis.axe.run());
    assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html)}`), []);
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), width);
    await picture(page, `${width}${dark ? "-dark" : ""}`);
    await program.stop();
    assert.deepEqual(wrong, []);
    await close();
  });
}
