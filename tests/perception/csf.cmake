# Units, display and contrast sensitivity; included by CMakeLists.txt.
unseen_add_test(NAME perception_units
    SOURCES units_test.cpp ${PROJECT_SOURCE_DIR}/tests/static/units_static_test.cpp
    DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_display SOURCES display_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_csf SOURCES csf_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_csf_models SOURCES csf_models_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_motion SOURCES motion_test.cpp DEPENDS unseen::perception LABELS unit)
unseen_add_test(NAME perception_csf_table SOURCES csf_table_test.cpp DEPENDS unseen::perception LABELS unit)
