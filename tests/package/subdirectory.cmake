# Takes the source folder into another project: what that one's cache says of CMake itself stays as it was, and, with BUILD,
# a program of it is built and runs.
cmake_minimum_required(VERSION 3.25)
function(configured in result)
    file(REMOVE_RECURSE ${WORK_DIR}/${in})
    execute_process(COMMAND ${CMAKE_COMMAND} -G ${GENERATOR} -S ${SOURCE_DIR} -B ${WORK_DIR}/${in} -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER}
            -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} ${ARGN}
        OUTPUT_VARIABLE output ERROR_VARIABLE output RESULT_VARIABLE failed)
    if(failed)
        message(FATAL_ERROR "${output}")
    endif()
    file(STRINGS ${WORK_DIR}/${in}/CMakeCache.txt entries REGEX "^(CMAKE|BUILD)_[A-Z_]*:[A-Z]+=")
    list(FILTER entries EXCLUDE REGEX ":(INTERNAL|STATIC)=|^CMAKE_CACHEFILE_DIR|^CMAKE_HOME_DIRECTORY")
    set(${result} "${entries}" PARENT_SCOPE)
endfunction()

configured(alone before)
configured(with_unseen after -DUNSEEN=${PROJECT})
if(NOT before STREQUAL after)
    set(more ${after})
    list(REMOVE_ITEM more ${before})
    message(FATAL_ERROR "add_subdirectory() has changed the cache of the project around it: ${more}")
endif()
if(BUILD)
    configured(optimised entries -DUNSEEN=${PROJECT} -DCMAKE_BUILD_TYPE=Release)
    execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK_DIR}/optimised --target around COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND ${WORK_DIR}/optimised/around COMMAND_ERROR_IS_FATAL ANY)
endif()
