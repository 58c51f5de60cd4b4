# unseen_embed_shaders(target file...)
#
# Compiles GLSL files into `target` as string views: shaders/surface.vert becomes unseen::render::shaders::surface_vert.
# The target's sources declare what they use in shaders.h; a name that is missing there or here fails to link. Runs at
# build time and needs nothing but CMake, which runs this same file as a script.
if(CMAKE_SCRIPT_MODE_FILE)
    set(text "// Made from the files under shaders/ by EmbedShaders.cmake: edit those.\n#include \"shaders.h\"\n\n")
    string(APPEND text "namespace unseen::render::shaders {\n\n")
    separate_arguments(files UNIX_COMMAND "${SHADERS}")
    foreach(file IN LISTS files)
        get_filename_component(name "${file}" NAME)
        string(MAKE_C_IDENTIFIER "${name}" name)
        file(READ "${file}" source)
        string(APPEND text "const std::string_view ${name} = R\"glsl(${source})glsl\";\n\n")
    endforeach()
    string(APPEND text "} // namespace unseen::render::shaders\n")
    file(WRITE "${OUTPUT}" "${text}")
    return()
endif()

set(UNSEEN_EMBED_SHADERS_SCRIPT ${CMAKE_CURRENT_LIST_FILE})

function(unseen_embed_shaders target)
    set(files)
    foreach(file IN LISTS ARGN)
        cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
        list(APPEND files ${file})
    endforeach()
    # Quoted one by one, so that a checkout under a path with spaces builds too.
    set(quoted)
    foreach(file IN LISTS files)
        string(APPEND quoted "\"${file}\" ")
    endforeach()
    set(output ${CMAKE_CURRENT_BINARY_DIR}/${target}_shaders.cpp)
    add_custom_command(OUTPUT ${output}
        COMMAND ${CMAKE_COMMAND} "-DSHADERS=${quoted}" "-DOUTPUT=${output}" -P ${UNSEEN_EMBED_SHADERS_SCRIPT}
        DEPENDS ${files} ${UNSEEN_EMBED_SHADERS_SCRIPT}
        COMMENT "Embedding shaders into ${target}" VERBATIM)
    target_sources(${target} PRIVATE ${output})
endfunction()
