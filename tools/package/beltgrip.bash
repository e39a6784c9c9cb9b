# Completion for beltgrip: subcommands and options as the program itself lists them, else file names.
_beltgrip() {
  local word=${COMP_WORDS[COMP_CWORD]} path=() known i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    [[ ${COMP_WORDS[i]} == -* ]] && break
    path+=("${COMP_WORDS[i]}")
    ((${#path[@]} == 2)) && break
  done
  # The second word counts where it is a subcommand of the first.
  known=$(beltgrip "${path[@]}" --help 2>/dev/null || beltgrip "${path[0]}" --help 2>/dev/null)
  if [[ $word == -* ]]; then
    known=$(grep -oE -- '--[a-z][a-z-]*' <<<"$known")
  else
    known=$(sed -n '/^Subcommands:/,$s/^  \([a-z-]*\) .*/\1/p' <<<"$known")
  fi
  mapfile -t COMPREPLY < <(compgen -W "$known" -- "$word")
}
complete -o default -F _beltgrip beltgrip
