# What the package of Debian holds and the source tree does not, into the folder `made`: changelogs and the man page.

function(compressed name)
  execute_process(COMMAND gzip -9nf ${made}/${name} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(WRITE ${made}/changelog.Debian
  "attrito (${version}-1) unstable; urgency=medium\n\n  * Built from the source tree; changes are in changelog.gz.\n\n -- ${maintainer}  ${date}\n")
compressed(changelog.Debian)
file(COPY_FILE ${source}/CHANGELOG.md ${made}/changelog)
compressed(changelog)

find_program(ARGPARSE_MANPAGE argparse-manpage)
if(NOT ARGPARSE_MANPAGE)
  message(FATAL_ERROR "argparse-manpage, which writes the man page, is not installed (script/package installs it)")
endif()
execute_process(COMMAND ${CMAKE_COMMAND} -E env PYTHONPATH=${source}/python ${ARGPARSE_MANPAGE} --module attrito.cli.arguments
  --function parser --project-name attrito OUTPUT_VARIABLE page COMMAND_ERROR_IS_FATAL ANY)
# It leaves out what `apropos` shows, and ends with headings for what it was not given.
string(REGEX REPLACE "\n\\.SH AUTHORS.*" "\n" page "${page}")
string(REPLACE ".SH NAME\nattrito\n" ".SH NAME\nattrito \\- the steady vibration of finite-element structures that rub\n" page "${page}")
file(WRITE ${made}/attrito.1 "${page}")
compressed(attrito.1)
