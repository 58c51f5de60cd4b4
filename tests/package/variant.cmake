# Builds the libraries by another compiler, or as shared ones, without tests, and makes of them what run.cmake does of the
# build at hand. Files that ccache knows take no time.
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND ${CMAKE_COMMAND} -G ${GENERATOR} -S ${PROJECT} -B ${WORK_DIR}/libraries -DCMAKE_CXX_COMPILER=${CMAKE_CXX_COMPILER}
        -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS=-Werror -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -DBUILD_SHARED_LIBS=${WITH_SHARED}
        -DUNSEEN_BUILD_TESTS=OFF -DUNSEEN_BUILD_APPS=OFF -DUNSEEN_BUILD_RENDER=${WITH_RENDER} -DUNSEEN_BUILD_SESSION=${WITH_SESSION}
    OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK_DIR}/libraries COMMAND_ERROR_IS_FATAL ANY)
set(BUILD_DIR ${WORK_DIR}/libraries)
include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)
