// Sessions to look at, made by the program under test: RAMPHOLD names it, else target/release or target/debug.
import { execFileSync } from "node:child_process";
import { cpSync, existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const root = new URL("../..", import.meta.url).pathname;

export function program() {
  const places = [process.env.RAMPHOLD, join(root, "target/release/ramphold"), join(root, "target/debug/ramphold")];
  const found = places.find((place) => place && existsSync(place));
  if (!found) throw new Error("no ramphold: build it, or name it with RAMPHOLD");
  return found;
}

/// A folder that goes away at the end of the process.
export function temporaryFolder() {
  const folder = mkdtempSync(join(tmpdir(), "ramphold-browser-"));
  process.on("exit", () => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/// The paper's session, its diagnosed copy, and one that was only measured.
export function sessions(folder) {
  const ramphold = program();
  const at = (name) => join(folder, name);
  const run = ["run", join(root, "protocols/de-vlugt-2011.json"), "--seed", "1", "--out", at("paper")];
  execFileSync(ramphold, run, { stdio: "pipe" });

  cpSync(at("paper"), at("diagnosed"), { recursive: true });
  cpSync(join(root, "fixtures/report/diagnosis.json"), join(at("diagnosed"), "results/diagnosis.json"));
  execFileSync(ramphold, ["report", at("diagnosed")], { stdio: "pipe" });

  for (const part of ["session.json", "trials.csv", "trials"]) {
    cpSync(join(at("paper"), part), join(at("bare"), part), { recursive: true });
  }
  execFileSync(ramphold, ["report", at("bare")], { stdio: "pipe" });
  const found = ["paper", "diagnosed", "bare"].map((name) => [name, join(at(name), "results/report.html")]);

  // People's data, when they are beside the checkout; its many trials and labels are what strains a page.
  const ankle = join(root, "../shared/data/ankle-0");
  if (existsSync(ankle)) {
    cpSync(ankle, at("ankle"), { recursive: true });
    execFileSync(ramphold, ["report", at("ankle")], { stdio: "pipe" });
    found.push(["ankle", join(at("ankle"), "results/report.html")]);
  } else {
    console.log("skipped: ../shared/data/ankle-0 is not there");
  }
  return Object.fromEntries(found);
}

/// Debian's browser.
export function browser() {
  const places = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser"];
  const found = places.find((place) => place && existsSync(place));
  if (!found) throw new Error("no chromium: apt-get install chromium, or name it with CHROMIUM");
  return found;
}
