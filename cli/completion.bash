# Completion of clearance and clearanced for bash: commands and options as the programs' own --help tells them.
_clearance() {
  local word=${COMP_WORDS[COMP_CWORD]} program=${COMP_WORDS[0]} path=() help commands i
  for ((i = 1; ; i++)); do
    help=$("$program" "${path[@]}" --help 2>/dev/null) || return
    commands=$(sed -n '/^S[Uu][Bb]/,/^$/s/^  \([a-z][a-z-]*\) .*/\1/p' <<<"$help")
    ((i < COMP_CWORD)) && grep -qxF -- "${COMP_WORDS[i]}" <<<"$commands" || break
    path+=("${COMP_WORDS[i]}")
  done
  if [[ $word = -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '--[a-z][a-z0-9-]*' <<<"$help")" -- "$word")
  elif ((i == COMP_CWORD)); then
    mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$word")
  fi
}
complete -o default -F _clearance clearance clearanced
