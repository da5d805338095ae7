"use strict";
(() => {
  // The trial picker: one figure is shown at a time.
  const select = document.getElementById("trial");
  if (select) {
    const show = () => {
      for (const trial of document.querySelectorAll(".trial")) {
        trial.hidden = trial.firstElementChild.id !== select.value;
      }
    };
    select.addEventListener("change", show);
    for (const button of document.querySelectorAll("[data-step]")) {
      button.addEventListener("click", () => {
        const count = select.options.length;
        select.selectedIndex = (select.selectedIndex + Number(button.dataset.step) + count) % count;
        show();
      });
    }
    show();
  }
  // Tables are copied with tabs, means and deviations in columns of their own.
  const copied = (cell) => cell.dataset.tsv ?? cell.textContent.replace("\u2212", "-");
  const tsv = (table) => [...table.rows].map((row) => [...row.cells].map(copied).join("\t")).join("\n");
  const put = async (text) => {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = document.body.appendChild(document.createElement("textarea"));
      area.value = text;
      area.select();
      document.execCommand("copy");
      area.remove();
    }
  };
  for (const button of document.querySelectorAll(".copy")) {
    button.addEventListener("click", async () => {
      await put(tsv(button.closest(".table").querySelector("table")));
      button.textContent = "copied";
      setTimeout(() => { button.textContent = "copy"; }, 1500);
    });
  }
})();
