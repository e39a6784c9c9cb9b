# Completion for beltgrip and beltgripd, for bash and, through bashcompinit, zsh: subcommands, options
# and the values of options as the programs' own help lists them; else names of files or interfaces.
# Names that zsh keeps for itself (path, words) are not used.
_beltgrip_interfaces() {
  local folder
  for folder in /sys/class/net/*can*; do
    [[ -e $folder ]] && echo "${folder##*/}"
  done
}
_beltgrip() {
  local word=${COMP_WORDS[COMP_CWORD]} program=${COMP_WORDS[0]} names=() help choices option i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    [[ ${COMP_WORDS[i]} == -* ]] && break
    names+=("${COMP_WORDS[i]}")
    ((${#names[@]} == 2)) && break
  done
  # "beltgrip help X" is about X, and the second word counts where it is a subcommand of the first.
  [[ ${names[0]} == help ]] && names=("${names[@]:1}")
  help=$("$program" "${names[@]}" --help 2>/dev/null || "$program" "${names[0]}" --help 2>/dev/null)
  option= choices=
  ((COMP_CWORD > 1)) && option=${COMP_WORDS[COMP_CWORD - 1]}
  if [[ $word == -* ]]; then
    choices=$(sed -nE 's/^  (-[A-Za-z],)?(--[a-z][a-z-]*).*/\2/p' <<<"$help")
  elif [[ $option == --scenario ]]; then
    choices=$(sed -nE 's/^  --scenario .*shipped scenario \(([^)]*)\).*/\1/p' <<<"$help" | tr -d ,)
  elif [[ $option == --* ]] && grep -qE -- "^  $option [A-Z]" <<<"$help"; then
    choices=$(sed -nE "s/^  $option [A-Z]+:\{([^}]*)\}.*/\1/p" <<<"$help" | tr , ' ')
    if grep -qE -- "^  $option (INTERFACE|BUS)" <<<"$help"; then
      choices=$(_beltgrip_interfaces)
    fi
  else
    choices=$(sed -n '/^Subcommands:/,$s/^  \([a-z-]*\) .*/\1/p' <<<"$help")
    [[ ${#names[@]} == 0 && $program == *beltgrip ]] && choices+=" help"
    if grep -qE '^  (INTERFACE|SOURCE)( |$)' <<<"$help"; then
      choices+=" $(_beltgrip_interfaces)"
    fi
  fi
  COMPREPLY=()
  while read -r i; do COMPREPLY+=("$i"); done < <(compgen -W "$choices" -- "$word")
}
complete -o default -F _beltgrip beltgrip beltgripd
