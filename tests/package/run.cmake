# Installs the build, then configures, builds and runs a consumer against it; any failure fails the test.
function(run)
    execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT result EQUAL 0)
        message(FATAL_ERROR "${ARGN}\n${output}")
    endif()
endfunction()

file(REMOVE_RECURSE ${WORK_DIR}/prefix ${WORK_DIR}/build ${WORK_DIR}/build-missing)
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)

# A module's first header includes all others of the module, and no public header needs one that is not installed.
file(GLOB modules ${WORK_DIR}/prefix/include/unseen/*)
foreach(folder IN LISTS modules)
    cmake_path(GET folder FILENAME module)
    file(GLOB headers RELATIVE ${folder} ${folder}/*.h)
    list(LENGTH headers count)
    if(count EQUAL 1) # which is the first
        continue()
    endif()
    file(READ ${folder}/${module}.h first)
    foreach(header IN LISTS headers)
        file(READ ${folder}/${header} text)
        if(text MATCHES "#include \"|#include <[a-z/]*internal/")
            message(FATAL_ERROR "<unseen/${module}/${header}> includes a header that is not installed.")
        endif()
        if(NOT header STREQUAL "${module}.h" AND NOT first MATCHES "#include <unseen/${module}/${header}>")
            message(FATAL_ERROR "<unseen/${module}/${module}.h> does not include <unseen/${module}/${header}>.")
        endif()
    endforeach()
endforeach()
run(${CMAKE_COMMAND} -G ${GENERATOR} -S ${SOURCE_DIR} -B ${WORK_DIR}/build -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix
    -DWITH_RENDER=${WITH_RENDER} -DWITH_SESSION=${WITH_SESSION}
    -DWITH_OPENMESH=${WITH_OPENMESH} -DWITH_CGAL=${WITH_CGAL} -DCMAKE_BUILD_TYPE=Release)
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/consumer)

# A component that does not exist is reported, not ignored.
execute_process(COMMAND ${CMAKE_COMMAND} -G ${GENERATOR} -S ${SOURCE_DIR} -B ${WORK_DIR}/build-missing
    -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix -DEXTRA_COMPONENT=teleportation
    RESULT_VARIABLE result OUTPUT_QUIET ERROR_VARIABLE message)
if(result EQUAL 0 OR NOT message MATCHES "teleportation")
    message(FATAL_ERROR "A missing component was not reported: ${message}")
endif()
