# Puts what the programs say of themselves into a manual page: awk -f man_options.awk PAGE.
# In PAGE the line
#   .\" COMMANDS FILE   becomes every command of FILE (tools/COMMANDS.md, which a test holds against
#                       the programs' table of options) with its options and examples;
#   .\" TEXT FILE       becomes FILE as it is.
function plain(text) {
  gsub(/\\/, "\\e", text)
  gsub(/-/, "\\-", text)
  sub(/^[.']/, "\\\\\\&&", text)
  return text
}
function entry(name, what) {
  print ".TP"
  print ".B " plain(name)
  if (what != "") print plain(what)
}
function commands(file,   line, inside, part, name, what) {
  while ((getline line < file) > 0) {
    if (line ~ /^### beltgrip /) {
      print ".SS " plain(substr(line, 5))
      part = "title"
    } else if (part == "title" && line == "```") {
      inside = 1
      part = "first"
    } else if (inside && line == "```") {
      if (part == "Examples:") print ".EE\n.RE"
      inside = 0
      part = ""
    } else if (inside && part == "first") {
      print plain(line)
      part = "text"
    } else if (inside && line ~ /^Usage: /) {
      print ".PP\n.B " plain(substr(line, 8))
    } else if (inside && line ~ /^[A-Z][A-Za-z ]*:$/) {
      part = line
      if (part == "Examples:") print ".PP\nExamples:\n.PP\n.RS 4\n.EX"
    } else if (inside && line == "") {
      continue
    } else if (inside && part == "Examples:") {
      print plain(substr(line, 3))
    } else if (inside && line ~ /^  [^ ]/) {
      name = substr(line, 3)
      what = ""
      if (match(name, /  +/)) {
        what = substr(name, RSTART + RLENGTH)
        name = substr(name, 1, RSTART - 1)
      }
      sub(/:FLOAT in /, " ", name)
      sub(/:INT in /, " ", name)
      sub(/:UINT in /, " ", name)
      entry(name, what)
    } else if (inside) {
      sub(/^ +/, "", line)
      print plain(line)
    }
  }
  close(file)
}
$1 == ".\\\"" && $2 == "COMMANDS" { commands($3); next }
$1 == ".\\\"" && $2 == "TEXT" {
  print ".EX"
  while ((getline line < $3) > 0) print plain(line)
  close($3)
  print ".EE"
  next
}
{ print }
