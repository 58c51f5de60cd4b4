# unseen_add_library(name SOURCES ... HEADERS ... DEPENDS ... PRIVATE_DEPENDS ... [PACKAGES ...] [LIBRARIES ...]
#                    [SINGLE ...])
#
# One module of the house: a library `unseen_<name>`, static or by BUILD_SHARED_LIBS shared, alias and export name
# `unseen::<name>`, whose public headers lie in include/unseen/<name> and are installed alike. DEPENDS is what its headers
# need, PRIVATE_DEPENDS what only its sources need. PACKAGES: the latter as pkg-config names them; LIBRARIES: those of them
# that pkg-config does not know. SINGLE: see unseen_unite_sources().
function(unseen_add_library name)
    cmake_parse_arguments(arg "" "" "SOURCES;HEADERS;DEPENDS;PRIVATE_DEPENDS;PACKAGES;LIBRARIES;SINGLE" ${ARGN})
    set(target unseen_${name})
    add_library(${target} ${arg_SOURCES})
    add_library(unseen::${name} ALIAS ${target})
    target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS include FILES ${arg_HEADERS})
    target_include_directories(${target} PRIVATE src)
    target_compile_features(${target} PUBLIC cxx_std_20)
    target_link_libraries(${target} PUBLIC ${arg_DEPENDS} PRIVATE ${arg_PRIVATE_DEPENDS})
    unseen_add_internal_headers(${name} ${arg_DEPENDS})
    target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:${target}_internal>)
    # Before 1.0 a minor version may change the ABI.
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} VERSION ${PROJECT_VERSION}
        SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} INSTALL_RPATH "$ORIGIN"
        LINK_DEPENDS ${UNSEEN_EXPORTS_SCRIPT})
    # What shared libraries show of themselves. Of static ones the options say nothing.
    target_link_options(${target} PRIVATE "LINKER:--version-script=${UNSEEN_EXPORTS_SCRIPT}")
    unseen_set_compile_options(${target})
    unseen_unite_sources(${target} SINGLE ${arg_SINGLE})
    if(UNSEEN_INSTALL)
        install(TARGETS ${target} EXPORT unseen_${name}_targets
            ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${name}
            LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${name}
            FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT ${name})
        install(EXPORT unseen_${name}_targets NAMESPACE unseen:: FILE unseen_${name}_targets.cmake
            DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unseen COMPONENT ${name})
        unseen_install_pkg_config(${name} DEPENDS ${arg_DEPENDS} PACKAGES ${arg_PACKAGES}
            LIBRARIES ${arg_LIBRARIES})
    endif()
endfunction()

# unseen_add_internal_headers(name depends...)
#
# An interface `unseen_<name>_internal`: headers in internal/include, which other modules may use but nobody installs, and
# those of the modules that this one depends on.
function(unseen_add_internal_headers name)
    set(target unseen_${name}_internal)
    add_library(${target} INTERFACE)
    if(IS_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/internal/include)
        target_include_directories(${target} INTERFACE $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/internal/include>)
    endif()
    unseen_link_internal_headers(${target} INTERFACE ${ARGN})
endfunction()

# Gives a target the internal headers of those of its dependencies that are modules.
function(unseen_link_internal_headers target scope)
    foreach(depends IN LISTS ARGN)
        string(REGEX REPLACE "^unseen::(.*)$" "unseen_\\1_internal" internal ${depends})
        if(internal MATCHES "^unseen_.*_internal$" AND TARGET ${internal})
            target_link_libraries(${target} ${scope} ${internal})
        endif()
    endforeach()
endfunction()

set(UNSEEN_EXPORTS_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/exports.map)
set(UNSEEN_PKG_CONFIG_FILE ${CMAKE_CURRENT_LIST_DIR}/unseen.pc.in)

# unseen-<name>.pc, with - for _. Where libraries are static, a client links what is inside, too, without asking for it.
function(unseen_install_pkg_config name)
    cmake_parse_arguments(arg "" "" "DEPENDS;PACKAGES;LIBRARIES" ${ARGN})
    set(needed)
    foreach(depends IN LISTS arg_DEPENDS)
        string(REGEX REPLACE "^glm::glm$" "glm" depends ${depends})
        string(REGEX REPLACE "^unseen::" "unseen-" depends ${depends})
        string(REPLACE "_" "-" depends ${depends})
        list(APPEND needed ${depends})
    endforeach()
    set(inside ${arg_PACKAGES})
    if(NOT BUILD_SHARED_LIBS)
        list(APPEND needed ${inside})
        set(inside)
    endif()
    set(PC_LIBRARIES)
    if(NOT BUILD_SHARED_LIBS)
        list(TRANSFORM arg_LIBRARIES PREPEND " -l")
        list(JOIN arg_LIBRARIES "" PC_LIBRARIES)
    endif()
    list(JOIN needed ", " PC_REQUIRES)
    list(JOIN inside ", " PC_REQUIRES_PRIVATE)
    string(REPLACE "_" "-" package ${name})
    set(PC_NAME ${name})
    # Folders may be absolute, as distributions set them.
    foreach(folder IN ITEMS LIBDIR INCLUDEDIR)
        set(PC_${folder} "\${prefix}/${CMAKE_INSTALL_${folder}}")
        if(IS_ABSOLUTE "${CMAKE_INSTALL_${folder}}")
            set(PC_${folder} "${CMAKE_INSTALL_${folder}}")
        endif()
    endforeach()
    # The prefix counts from the file, so that an installed folder may be moved.
    set(place /${CMAKE_INSTALL_LIBDIR}/pkgconfig)
    cmake_path(RELATIVE_PATH place BASE_DIRECTORY / OUTPUT_VARIABLE below)
    string(REGEX REPLACE "[^/]+" ".." PC_UP "${below}")
    configure_file(${UNSEEN_PKG_CONFIG_FILE} ${PROJECT_BINARY_DIR}/unseen-${package}.pc @ONLY)
    install(FILES ${PROJECT_BINARY_DIR}/unseen-${package}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
        COMPONENT ${name})
endfunction()

# unseen_add_adapter(name HEADERS ... DEPENDS ...)
#
# Headers alone, for those who use another library as well: an interface `unseen_<name>`, named and installed alike.
function(unseen_add_adapter name)
    cmake_parse_arguments(arg "" "" "HEADERS;DEPENDS" ${ARGN})
    set(target unseen_${name})
    add_library(${target} INTERFACE)
    add_library(unseen::${name} ALIAS ${target})
    target_sources(${target} INTERFACE FILE_SET HEADERS BASE_DIRS include FILES ${arg_HEADERS})
    target_compile_features(${target} INTERFACE cxx_std_20)
    target_link_libraries(${target} INTERFACE ${arg_DEPENDS})
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
    if(UNSEEN_INSTALL)
        install(TARGETS ${target} EXPORT unseen_${name}_targets
            FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT ${name})
        install(EXPORT unseen_${name}_targets NAMESPACE unseen:: FILE unseen_${name}_targets.cmake
            DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unseen COMPONENT ${name})
    endif()
endfunction()

function(unseen_set_compile_options target)
    target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wconversion -Wshadow)
    # Position-independent code must not keep a module's own functions from being inlined: nobody replaces them at load time.
    target_compile_options(${target} PRIVATE -fno-semantic-interposition)
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
        # GCC 12 sees overlapping copies in literal + std::string (GCC bug 105651).
        target_compile_options(${target} PRIVATE -Wno-restrict)
        # From -O2 on, its vectoriser of straight-line code forgets that dvec3(vec3(p)) rounds to float.
        target_compile_options(${target} PRIVATE -fno-tree-slp-vectorize)
    endif()
endfunction()

option(UNSEEN_UNITE_SOURCES "Compile several sources of a target at once: three times as fast" ON)

# Compiles several sources of a target at once, so that headers are read once for all of them: those that have the same
# options. For targets whose sources use no name for two things; the sources in SINGLE stay alone. The preset `dev` compiles
# each alone, so that each includes what it uses.
function(unseen_unite_sources target)
    cmake_parse_arguments(arg "" "" "SINGLE" ${ARGN})
    if(NOT UNSEEN_UNITE_SOURCES)
        return()
    endif()
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
        target_compile_options(${target} PRIVATE -Wno-subobject-linkage) # knows only the outermost file as a source
    endif()
    target_compile_options(${target} PRIVATE -Wno-shadow) # one source's names are not another's
    # Later in the folder's file, sources may be added and get options.
    cmake_language(EVAL CODE "cmake_language(DEFER CALL unseen_write_united_sources [[${target}]] [[${arg_SINGLE}]])")
endfunction()

# CMake's own UNITY_BUILD names sources by absolute paths, so that ccache would not know them in another folder.
function(unseen_write_united_sources target single)
    target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
    cmake_path(RELATIVE_PATH CMAKE_CURRENT_SOURCE_DIR BASE_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE folder)
    get_target_property(sources ${target} SOURCES)
    set(batch_size 8)
    set(kinds) # of sources, by their options
    foreach(source IN LISTS sources)
        if(IS_ABSOLUTE ${source} OR source IN_LIST single OR NOT source MATCHES "\\.cpp$")
            continue()
        endif()
        get_source_file_property(options ${source} COMPILE_OPTIONS)
        string(MD5 kind "${options}")
        list(APPEND kinds ${kind})
        list(APPEND sources_of_${kind} ${source})
        set(options_of_${kind} ${options})
        set_source_files_properties(${source} PROPERTIES HEADER_FILE_ONLY ON)
    endforeach()
    list(REMOVE_DUPLICATES kinds)
    set(number 0)
    foreach(kind IN LISTS kinds)
        set(text)
        set(count 0)
        list(LENGTH sources_of_${kind} left)
        foreach(source IN LISTS sources_of_${kind})
            string(APPEND text "#include \"${folder}/${source}\"\n")
            math(EXPR count "${count} + 1")
            math(EXPR left "${left} - 1")
            if(count LESS batch_size AND left GREATER 0)
                continue()
            endif()
            set(file ${CMAKE_CURRENT_BINARY_DIR}/united/${target}_${number}.cpp)
            file(CONFIGURE OUTPUT ${file} CONTENT "${text}" @ONLY)
            target_sources(${target} PRIVATE ${file})
            if(options_of_${kind})
                set_source_files_properties(${file} PROPERTIES COMPILE_OPTIONS "${options_of_${kind}}")
            endif()
            set(text)
            set(count 0)
            math(EXPR number "${number} + 1")
        endforeach()
    endforeach()
endfunction()

function(unseen_install_package)
    include(CMakePackageConfigHelpers)
    configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/unseenConfig.cmake.in
        ${PROJECT_BINARY_DIR}/unseenConfig.cmake INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unseen)
    write_basic_package_version_file(${PROJECT_BINARY_DIR}/unseenConfigVersion.cmake COMPATIBILITY SameMinorVersion)
    install(FILES ${PROJECT_BINARY_DIR}/unseenConfig.cmake ${PROJECT_BINARY_DIR}/unseenConfigVersion.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/unseen)
endfunction()
