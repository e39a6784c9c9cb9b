# Completion for beltgripd: that of beltgrip knows both.
source "${BASH_SOURCE[0]%/*}/beltgrip"
