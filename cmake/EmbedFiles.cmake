# unseen_embed_files(target NAMESPACE name HEADER header FILES file...)
#
# Compiles text files into `target` as string views: with the namespace unseen::render::shaders, shaders/surface.vert becomes
# unseen::render::shaders::surface_vert. The header, which the target's sources include, declares them; a name that is missing
# there or here fails to link. Runs at build time and needs nothing but CMake, which runs this same file as a script.
if(CMAKE_SCRIPT_MODE_FILE)
    set(text "// Made by EmbedFiles.cmake from the files below: edit those.\n#include \"${HEADER}\"\n\n")
    string(APPEND text "namespace ${NAMESPACE} {\n\n")
    separate_arguments(files UNIX_COMMAND "${FILES}")
    foreach(file IN LISTS files)
        get_filename_component(name "${file}" NAME)
        string(MAKE_C_IDENTIFIER "${name}" name)
        file(READ "${file}" source)
        string(APPEND text "const std::string_view ${name} = R\"embedded(${source})embedded\";\n\n")
    endforeach()
    string(APPEND text "} // namespace ${NAMESPACE}\n")
    file(WRITE "${OUTPUT}" "${text}")
    return()
endif()

set(UNSEEN_EMBED_FILES_SCRIPT ${CMAKE_CURRENT_LIST_FILE})

function(unseen_embed_files target)
    cmake_parse_arguments(arg "" "NAMESPACE;HEADER" "FILES" ${ARGN})
    set(files)
    foreach(file IN LISTS arg_FILES)
        cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
        list(APPEND files ${file})
    endforeach()
    # Quoted one by one, so that a checkout under a path with spaces builds too.
    set(quoted)
    foreach(file IN LISTS files)
        string(APPEND quoted "\"${file}\" ")
    endforeach()
    set(output ${CMAKE_CURRENT_BINARY_DIR}/${target}_embedded.cpp)
    add_custom_command(OUTPUT ${output}
        COMMAND ${CMAKE_COMMAND} "-DFILES=${quoted}" "-DOUTPUT=${output}" "-DNAMESPACE=${arg_NAMESPACE}" "-DHEADER=${arg_HEADER}"
            -P ${UNSEEN_EMBED_FILES_SCRIPT}
        DEPENDS ${files} ${UNSEEN_EMBED_FILES_SCRIPT}
        COMMENT "Embedding files into ${target}" VERBATIM)
    target_sources(${target} PRIVATE ${output})
endfunction()
