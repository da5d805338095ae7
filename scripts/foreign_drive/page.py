"""Writes the column "seen with a drive that shares no code" of the fault table."""

COLUMN = "seen with a drive that shares no code"
BEGIN, END = "<!-- scripts/foreign-drive -->", "<!-- end -->"
# Rows that no drive, bus or signal on this bench can cause.
NOT_CAUSED = {}


def write_column(page, verdicts, build):
    """Fills the last column of the table between the markers. Returns rows that no try covers, and tries without a row."""
    before, rest = page.read_text().split(BEGIN, 1)
    table, after = rest.split(END, 1)
    lines = [line for line in table.splitlines() if line.startswith("|")]
    missing, written, rows = [], [], set()
    for number, line in enumerate(lines):
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        cells = cells[:3]
        if number == 0:
            cells.append(COLUMN)
        elif number == 1:
            cells = ["---"] * 4
        else:
            row = cells[0]
            rows.add(row)
            seen = [verdict.cell().replace("|", "\\|") for verdict in verdicts if verdict.row == row]
            if not seen and row not in NOT_CAUSED:
                missing.append(row)
            cells.append("<br>".join(seen) or "not caused: " + NOT_CAUSED.get(row, "no try"))
        written.append("| " + " | ".join(cells) + " |" if number != 1 else "|" + "|".join(cells) + "|")
    missing += sorted({verdict.row for verdict in verdicts} - rows)
    broken = sum(bool(verdict.broken) for verdict in verdicts)
    unseen = sum(bool(verdict.blind) for verdict in verdicts)
    summary = (f"Written by `scripts/foreign-drive` with {build}: {len(verdicts) - broken - unseen} of {len(verdicts)} tries ended as "
               f"promised, {broken} did not, {unseen} were not seen.")
    page.write_text(f"{before}{BEGIN}\n" + "\n".join(written) + f"\n\n{summary}\n{END}{after}")
    return missing
