# Completion of clearance and clearanced for bash: commands and options as the programs' own --help tells them.
_clearance() {
  local word=${COMP_WORDS[COMP_CWORD]} program=${COMP_WORDS[0]} command=() help
  if [[ ${program##*/} = clearance ]] && ((COMP_CWORD > 1)); then command=("${COMP_WORDS[1]}"); fi
  help=$("$program" "${command[@]}" --help 2>/dev/null) || return
  if [[ $word = -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$(grep -oE -- '--[a-z][a-z0-9-]*' <<<"$help")" -- "$word")
  elif [[ ${program##*/} = clearance ]] && ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "$(sed -n '/^S[Uu][Bb]/,/^$/s/^  \([a-z][a-z-]*\) .*/\1/p' <<<"$help")" -- "$word")
  fi
}
complete -o default -F _clearance clearance clearanced
