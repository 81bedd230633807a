# Tab completes commands, options and files of perfplast, where argcomplete is installed.
if command -q register-python-argcomplete
    register-python-argcomplete --shell fish perfplast | source
end
