# Makes the files beside it, with VTK 9.1 as Debian 12 has it (python3-vtk9): python3 make_files.py
#
# Six points, a quad, a strip of two triangles, a vertex cell, a line, and point data of several kinds.
import vtk

mesh = vtk.vtkPolyData()
points = vtk.vtkPoints()
for place in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0.5)]:
    points.InsertNextPoint(place)
mesh.SetPoints(points)


def cells(*lists):
    array = vtk.vtkCellArray()
    for corners in lists:
        array.InsertNextCell(len(corners))
        for corner in corners:
            array.InsertCellPoint(corner)
    return array


mesh.SetVerts(cells([0]))
mesh.SetLines(cells([0, 1]))
mesh.SetPolys(cells([0, 1, 2, 3]))
mesh.SetStrips(cells([1, 4, 2, 5]))


def array(kind, name, components, values):
    made = kind()
    made.SetName(name)
    made.SetNumberOfComponents(components)
    made.SetNumberOfTuples(len(values) // components)
    for i, value in enumerate(values):
        made.SetValue(i, value)
    return made


data = mesh.GetPointData()
data.SetScalars(array(vtk.vtkDoubleArray, "T in K", 1, [0.1, 0.2, float("nan"), 4, 5, float("inf")]))
data.SetNormals(array(vtk.vtkFloatArray, "Normals", 3, [0, 0, 1] * 6))
data.SetTCoords(array(vtk.vtkFloatArray, "TC", 2, [i / 16 for i in range(12)]))
data.AddArray(array(vtk.vtkIdTypeArray, "ids", 1, [3, 1, 4, 1, 5, 9]))
data.AddArray(array(vtk.vtkUnsignedCharArray, "RGB", 3, [0, 128, 255] * 6))
velocity = array(vtk.vtkFloatArray, "velocity", 3, [i / 8 for i in range(18)])
velocity.SetComponentName(0, "vx")
data.AddArray(velocity)
words = vtk.vtkStringArray()
words.SetName("words")
for word in ["a", "b b", "", "d", "e" * 70, "f"]:
    words.InsertNextValue(word)
data.AddArray(words)
bits = vtk.vtkBitArray()
bits.SetName("bits")
for bit in [0, 1, 1, 0, 1, 0]:
    bits.InsertNextValue(bit)
data.AddArray(bits)
mesh.GetCellData().AddArray(array(vtk.vtkFloatArray, "quality", 1, [1, 2, 3, 4]))
mesh.GetFieldData().AddArray(array(vtk.vtkDoubleArray, "TimeValue", 1, [3.5]))


def write_xml(file, mode, compressor="None", base64=False, other=False):
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputData(mesh)
    writer.SetFileName(file)
    getattr(writer, "SetDataModeTo" + mode)()
    getattr(writer, "SetCompressorTypeTo" + compressor)()
    writer.SetEncodeAppendedData(base64)
    if other:
        writer.SetByteOrderToBigEndian()
        writer.SetHeaderTypeToUInt64()
    writer.Write()


write_xml("ascii.vtp", "Ascii")
write_xml("binary.vtp", "Binary")
write_xml("binary_zlib_big64.vtp", "Binary", "ZLib", other=True)
write_xml("raw_big64.vtp", "Appended", other=True)
write_xml("raw_zlib.vtp", "Appended", "ZLib")
write_xml("base64_zlib.vtp", "Appended", "ZLib", base64=True)
write_xml("base64_big64.vtp", "Appended", base64=True, other=True)
write_xml("raw_lz4.vtp", "Appended", "LZ4")
