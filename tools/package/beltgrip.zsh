#compdef beltgrip beltgripd
# zsh takes the completion of bash, which lies beside it under share/.
autoload -Uz bashcompinit && bashcompinit
source ${${(%):-%x}:A:h:h:h}/bash-completion/completions/beltgrip
_bash_complete -o default -F _beltgrip
