// xml_transform.c: the operations of <transform>. Each multiplies from the left: the first listed acts first.
#include "io/xml_parts.h"

#include <float.h>
#include <math.h>
#include <string.h>

void rey_xml_identity(double matrix[16]) {
    for (int i = 0; i < 16; i++) {
        matrix[i] = i % 5 == 0;
    }
}

void rey_xml_multiply_left(double matrix[16], const double left[16]) {
    double product[16];
    for (int row = 0; row < 4; row++) {
        for (int column = 0; column < 4; column++) {
            double sum = 0;
            for (int k = 0; k < 4; k++) {
                sum += left[row * 4 + k] * matrix[k * 4 + column];
            }
            product[row * 4 + column] = sum;
        }
    }
    memcpy(matrix, product, sizeof product);
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

// False when the vector is (nearly) zero compared to `scale`.
static bool normalise(double v[3], double scale) {
    double length = sqrt(dot(v, v));
    if (!(length > 1e-12 * scale)) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        v[i] /= length;
    }
    return true;
}

// Rotation by an angle about a unit axis: R = c I + s [a]x + (1 - c) a a^T (Rodrigues).
static void rotation(const double a[3], double degrees, double out[16]) {
    double radians = degrees * (3.14159265358979323846 / 180);
    double c = cos(radians), s = sin(radians);
    const double skew[9] = {0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0};
    rey_xml_identity(out);
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            out[i * 4 + j] = (i == j) * c + s * skew[i * 3 + j] + (1 - c) * a[i] * a[j];
        }
    }
}

// Camera frame: columns left, up, direction, origin; it looks along local +z and local +x is left.
static const char *lookat(const double origin[3], const double target[3], const double up[3], double out[16]) {
    double direction[3], left[3], new_up[3], y[3];
    double scale = fabs(origin[0]) + fabs(origin[1]) + fabs(origin[2]);
    for (int i = 0; i < 3; i++) {
        direction[i] = target[i] - origin[i];
        y[i] = up[i];
    }
    if (!normalise(direction, scale)) {
        return "origin and target coincide";
    }
    if (!normalise(y, 0)) { // no up given: the axis that is most nearly perpendicular
        int axis = 0;
        for (int i = 1; i < 3; i++) {
            axis = fabs(direction[i]) < fabs(direction[axis]) ? i : axis;
        }
        for (int i = 0; i < 3; i++) {
            y[i] = i == axis;
        }
    }
    cross(y, direction, left);
    if (!normalise(left, 1e4)) {
        return "'up' is parallel to the viewing direction";
    }
    cross(direction, left, new_up);
    rey_xml_identity(out);
    for (int i = 0; i < 3; i++) {
        out[i * 4] = left[i];
        out[i * 4 + 1] = new_up[i];
        out[i * 4 + 2] = direction[i];
        out[i * 4 + 3] = origin[i];
    }
    return NULL;
}

static rey_result read_point(XmlReader *reader, const XmlAttribute *attribute, double out[3]) {
    int count = 0;
    rey_result result = rey_xml_read_numbers(reader, attribute, 3, out, &count);
    return result || count == 3
               ? result
               : rey_xml_fail(reader->ctx, attribute->at, REY_ERROR_SCENE, "bad %s '%.60s', expected three numbers",
                              attribute->name, attribute->value);
}

static rey_result read_lookat(XmlReader *reader, const XmlAttributes *attributes, rey_xml_position at, double out[16]) {
    double points[3][3] = {{0}};
    static const char *const names[] = {"origin", "target", "up"};
    for (int i = 0; i < 3; i++) {
        const XmlAttribute *attribute = rey_xml_attribute_named(attributes, names[i]);
        rey_result result = attribute ? read_point(reader, attribute, points[i]) : REY_OK;
        if (result) {
            return result;
        }
    }
    const char *wrong = lookat(points[0], points[1], points[2], out);
    return wrong ? rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "bad <lookat>: %s", wrong) : REY_OK;
}

static rey_result read_matrix(XmlReader *reader, const XmlAttribute *value, double out[16]) {
    double numbers[16] = {0};
    int count = 0;
    rey_result result = rey_xml_read_numbers(reader, value, 16, numbers, &count);
    if (result) {
        return result;
    }
    if (count != 9 && count != 16) {
        return rey_xml_fail(reader->ctx, value->at, REY_ERROR_SCENE, "%d numbers in a matrix, expected 16 or 9", count);
    }
    rey_xml_identity(out);
    for (int i = 0; i < count; i++) {
        out[count == 16 ? i : i / 3 * 4 + i % 3] = numbers[i];
    }
    if (out[12] != 0 || out[13] != 0 || out[14] != 0 || out[15] != 1) {
        return rey_xml_fail(reader->ctx, value->at, REY_ERROR_SCENE,
                            "the matrix is not affine, expected the last row 0 0 0 1");
    }
    return REY_OK;
}

static rey_result read_rotation(XmlReader *reader, const XmlAttributes *attributes, rey_xml_position at,
                                double out[16]) {
    double axis[3], angle = 0;
    int count = 0;
    const XmlAttribute *attribute = rey_xml_attribute_named(attributes, "angle");
    rey_result result = rey_xml_read_vector(reader, attributes, 0, axis);
    if (!result) {
        result = rey_xml_read_numbers(reader, attribute, 1, &angle, &count);
    }
    if (result) {
        return result;
    }
    if (count != 1) {
        return rey_xml_fail(reader->ctx, attribute->at, REY_ERROR_SCENE, "bad angle '%.60s', expected degrees",
                            attribute->value);
    }
    if (!normalise(axis, 0)) {
        return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "<rotate> needs an axis: x, y, z or value");
    }
    rotation(axis, angle, out);
    return REY_OK;
}

rey_result rey_xml_apply_operation(XmlReader *reader, const XmlTag *tag, const XmlAttributes *attributes,
                                   rey_xml_position at, double matrix[16]) {
    double operation[16], v[3];
    rey_result result = REY_OK;
    rey_xml_identity(operation);
    switch ((XmlOperation)tag->which) {
    case XML_TRANSLATE:
        result = rey_xml_read_vector(reader, attributes, 0, v);
        for (int i = 0; i < 3 && !result; i++) {
            operation[i * 4 + 3] = v[i];
        }
        break;
    case XML_SCALE:
        result = rey_xml_read_vector(reader, attributes, 1, v);
        for (int i = 0; i < 3 && !result; i++) {
            operation[i * 5] = v[i];
        }
        break;
    case XML_ROTATE:
        result = read_rotation(reader, attributes, at, operation);
        break;
    case XML_LOOKAT:
        result = read_lookat(reader, attributes, at, operation);
        break;
    case XML_MATRIX:
        result = read_matrix(reader, rey_xml_attribute_named(attributes, "value"), operation);
        break;
    }
    if (result) {
        return result;
    }
    rey_xml_multiply_left(matrix, operation);
    for (int i = 0; i < 16; i++) {
        if (!(fabs(matrix[i]) <= (double)FLT_MAX)) {
            return rey_xml_fail(reader->ctx, at, REY_ERROR_SCENE, "the transform overflows");
        }
    }
    return REY_OK;
}
