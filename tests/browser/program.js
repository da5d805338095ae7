// A session of the program with its console, for pages to look at.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { createInterface } from "node:readline";

import { program } from "./sessions.js";

const running = new Set();
process.on("exit", stopAll);

/// Ends what a failed test left running: node would wait for it.
export function stopAll() {
  running.forEach((child) => child.kill("SIGKILL"));
}

/// Starts the program and waits for the addresses of its pages, which it prints on lines of their own.
export async function start(args, { cwd } = {}) {
  const child = spawn(program(), args, { cwd, stdio: ["ignore", "pipe", "pipe"] });
  const said = [];
  const ended = once(child, "close").then(([code]) => code);
  running.add(child);
  ended.then(() => running.delete(child));
  const pages = [];
  const ready = new Promise((resolve, reject) => {
    createInterface({ input: child.stderr }).on("line", (line) => {
      said.push(line);
      if (/^https?:\/\/\S+$/.test(line)) pages.push(line);
      if (pages.length === 2) resolve();
    });
    ended.then(() => reject(new Error(`it ended before it served anything:\n${said.join("\n")}`)));
  });
  let printed = "";
  child.stdout.on("data", (data) => (printed += data));
  await ready;
  const [operator, subject] = pages;
  return {
    operator, subject, ended, said, child,
    printed: () => printed,
    /// Ends it, however it is.
    async stop() {
      child.kill("SIGTERM");
      return ended;
    },
  };
}
