//! Products of any form as named arrays: an array per field of a record.

use crate::decode::NpyArray;
use crate::encode::kind::{Form, ValueKind};
use crate::encode::npy::{self, Array, NpyArrays};
use crate::json;
use crate::known::KnownProducts;
use std::collections::BTreeMap;
use syntable_model::error::{Error, Result};
use syntable_model::product::{KeyId, Tensor, Value};
use syntable_model::scene::InstanceId;

/// Suffix of the name of an array of JSON texts.
const JSON_END: &str = "_json";

/// The named arrays of a product, and the ids of the instances along their first axis, if it has values per instance.
pub struct NamedArrays {
    /// Names and arrays.
    pub arrays: Vec<(String, Array)>,
    /// Ids of the instances.
    pub ids: Option<Array>,
}

/// Refuses a kind of value that no arrays hold. A refusal is a reason and a remedy.
pub fn check(kind: &ValueKind) -> Result<(), String> {
    match kind.form {
        Form::Bytes => Err("an array holds numbers and text, not bytes; write it with jsonl".to_owned()),
        _ => Ok(()),
    }
}

/// The arrays of a product; `size` is the height and width of an image without instances. Numbers and texts are one
/// array with the product's name. A record is an array `{product}_{field}` per field; the records of a list or of
/// instances are along the first axis. A product or field that is neither text nor numbers of one shape is JSON text, in
/// an array whose name ends with `_json`.
///
/// # Errors
/// If the product has numbers of a known form, and the values of its instances differ in shape. An error names the product.
pub fn arrays(product: &str, key: &KeyId, value: &Value, size: [usize; 2]) -> Result<NamedArrays> {
    let explain = |error: Error| error.context(format!("product `{product}`"));
    let form = key.form().of_one().clone();
    let (values, ids): (Vec<&Value>, Option<Array>) = match value {
        Value::PerInstance(each) => (each.values().collect(), Some(Array::ids(each.keys().copied()))),
        value => (vec![value], None),
    };
    let are = |values: &[&Value]| !values.is_empty() && values.iter().all(|value| matches!(value, Value::Record(_)));
    let arrays = match value {
        Value::List(records) if form == Form::Records || are(&records.iter().collect::<Vec<_>>()) => {
            fields(product, &records.iter().collect::<Vec<_>>(), true)
        }
        _ if form == Form::Record || are(&values) => fields(product, &values, ids.is_some()),
        _ => {
            let of_any = || {
                let one = column(product.to_owned(), &values.iter().copied().map(Some).collect::<Vec<_>>());
                one.map(|column| vec![unstacked(column, ids.is_some())])
            };
            match form {
                Form::Text | Form::Records => of_any(),
                Form::Any | Form::List => of_numbers(product, key, value, size).or_else(|_| of_any()),
                // The error names the product.
                _ => return Ok(NamedArrays { arrays: of_numbers(product, key, value, size)?, ids }),
            }
        }
    };
    Ok(NamedArrays { arrays: arrays.map_err(explain)?, ids })
}

fn of_numbers(product: &str, key: &KeyId, value: &Value, size: [usize; 2]) -> Result<Vec<(String, Array)>> {
    let (NpyArrays::One(array) | NpyArrays::PerInstance { values: array, .. }) =
        npy::arrays(product, key, value, size)?;
    Ok(vec![(product.to_owned(), array)])
}

fn text(value: &Value) -> Option<&str> {
    if let Value::Text(text) = value { Some(text) } else { None }
}

/// The arrays of the fields of records, along the first axis if `stacked`, in the order in which fields first occur.
fn fields(product: &str, records: &[&Value], stacked: bool) -> Result<Vec<(String, Array)>> {
    let mut columns: Vec<(&str, Vec<Option<&Value>>)> = Vec::new();
    for (row, record) in records.iter().enumerate() {
        let Value::Record(fields) = record else { return Err(Error::new("some values are records, and others not")) };
        for (name, value) in fields {
            let column = match columns.iter_mut().find(|(known, _)| known == name) {
                Some((_, column)) => column,
                None => {
                    columns.push((name, vec![None; records.len()]));
                    &mut columns.last_mut().expect("just added").1
                }
            };
            column[row] = Some(value).filter(|value| **value != Value::Null);
        }
    }
    // A record whose field is null lacks the field.
    columns.retain(|(_, column)| column.iter().any(Option::is_some));
    let array = |(field, values): (&str, Vec<Option<&Value>>)| {
        Ok(unstacked(column(format!("{product}_{field}"), &values)?, stacked))
    };
    columns.into_iter().map(array).collect()
}

/// An array without its first axis, unless it is `stacked`.
fn unstacked((name, mut array): (String, Array), stacked: bool) -> (String, Array) {
    if !stacked {
        array.shape.remove(0);
    }
    (name, array)
}

/// The values of a field along the first axis; as JSON texts if no other array can hold them.
fn column(mut name: String, values: &[Option<&Value>]) -> Result<(String, Array)> {
    if let Some(array) = column_of(values) {
        return Ok((name, array));
    }
    name.push_str(JSON_END);
    let text = |value: &Option<&Value>| value.map_or(Ok(String::new()), json::text);
    let texts = values.iter().map(text).collect::<Result<Vec<String>>>()?;
    Ok((name, Array::texts(&texts.iter().map(String::as_str).collect::<Vec<_>>())))
}

/// The values of a field as one array: NaN for missing numbers, empty text for missing texts. None if the values have
/// different shapes or are neither numbers nor texts.
fn column_of(column: &[Option<&Value>]) -> Option<Array> {
    let present = || column.iter().flatten();
    if present().all(|value| matches!(value, Value::Text(_))) {
        return Some(Array::texts(
            &column.iter().map(|value| value.and_then(text).unwrap_or_default()).collect::<Vec<_>>(),
        ));
    }
    let arrays = column.iter().map(|value| value.map(Array::of).transpose().ok()).collect::<Option<Vec<_>>>()?;
    if let Ok(array) = Array::stack(arrays.iter().flatten().cloned().map(Ok))
        && array.shape[0] == column.len()
    {
        return Some(array);
    }
    let shape = arrays.iter().flatten().next()?.shape.clone();
    let mut bytes = Vec::new();
    for array in &arrays {
        match array {
            Some(array) if array.shape == shape => bytes.extend(array.as_f64()?.into_iter().flat_map(f64::to_le_bytes)),
            Some(_) => return None,
            None => bytes.extend((0..shape.iter().product()).flat_map(|_| f64::NAN.to_le_bytes())),
        }
    }
    Some(Array { descr: "<f8".into(), shape: [vec![column.len()], shape].concat(), bytes })
}

/// The product of an array: the product with the array's name, or else the product of records with the longest name that
/// begins the array's name. The array's own name if no known product fits.
pub fn product_of(array: &str, known: &KnownProducts) -> String {
    if known.named(array).is_some() {
        return array.to_owned();
    }
    let has_records = |key: &&KeyId| matches!(key.form().of_one(), Form::Record | Form::Records | Form::List);
    let names = known.iter().filter(has_records).map(ToString::to_string);
    let owners = names.filter(|name| array.strip_prefix(name.as_str()).is_some_and(|rest| rest.starts_with('_')));
    owners.max_by_key(String::len).unwrap_or_else(|| array.to_owned())
}

/// The values of a field: the whole array if it `is_one`, otherwise its rows along the first axis. None for a missing
/// value.
fn rows(array: &NpyArray, is_one: bool, is_json: bool) -> Result<Vec<Option<Value>>> {
    let wrong = |shape: &[usize]| Error::new(format!("its lengths are {shape:?}"));
    let tensor = match array {
        NpyArray::Texts(texts, shape) if shape.len() == usize::from(!is_one) => {
            return texts.iter().map(|text| of_text(text, is_json)).collect();
        }
        NpyArray::Texts(_, shape) => return Err(wrong(shape)),
        NpyArray::Numbers(tensor) if is_one => return Ok(vec![Some(of_tensor(tensor.clone(), false))]),
        NpyArray::Numbers(tensor) => tensor,
    };
    let (count, shape) = tensor.shape.split_first().ok_or_else(|| wrong(&[]))?;
    let width: usize = shape.iter().product();
    let size = width * tensor.dtype.size();
    let row = |row: usize| Tensor {
        dtype: tensor.dtype,
        axes: tensor.axes[1..].to_vec(),
        shape: shape.to_vec(),
        bytes: tensor.bytes[row * size..][..size].to_vec(),
    };
    let all = |row: &Tensor, is: fn(f64) -> bool| {
        (0..width).all(|at| matches!(row.element(at), Value::Float(value) if is(value)))
    };
    let rows: Vec<Option<Tensor>> =
        (0..*count).map(row).map(|row| Some(row).filter(|row| width == 0 || !all(row, f64::is_nan))).collect();
    // Integers are floats beside missing values.
    let are_integers = rows.contains(&None) && rows.iter().flatten().all(|row| all(row, |value| value.fract() == 0.0));
    Ok(rows.into_iter().map(|row| row.map(|row| of_tensor(row, are_integers))).collect())
}

fn of_text(text: &str, is_json: bool) -> Result<Option<Value>> {
    match (text.is_empty(), is_json) {
        (true, _) => Ok(None),
        (false, false) => Ok(Some(text.into())),
        (false, true) => {
            let json: serde_json::Value = serde_json::from_str(text)
                .map_err(|error| json::located(&error, None, text.as_bytes()).context("its JSON text"))?;
            Value::of(&json).map(Some)
        }
    }
}

/// A number, or an array of numbers.
fn of_tensor(tensor: Tensor, are_integers: bool) -> Value {
    let number = |at: usize| match tensor.element(at) {
        Value::Float(value) if are_integers => Value::Int(value as i64),
        value => value,
    };
    match tensor.shape.as_slice() {
        [] => number(0),
        [length] => Value::List((0..*length).map(number).collect()),
        _ => Value::Tensor(tensor),
    }
}

/// Whether the values of a product are read by [`value`]: records, texts, and lists that no array of numbers holds.
pub fn is_of_arrays(key: &KeyId, has_numbers: bool) -> bool {
    match key.form().of_one() {
        Form::Record | Form::Records | Form::Text => true,
        Form::List => !has_numbers,
        _ => false,
    }
}

/// Whether a value of a product may have no arrays: a list without records, or the records of no instances.
pub fn may_be_absent(key: &KeyId, has_no_instances: bool) -> bool {
    match key.form() {
        Form::Records => true,
        Form::PerInstance(one) => has_no_instances && *one == Form::Record,
        _ => false,
    }
}

/// The value of a product that [is of arrays](is_of_arrays), from its arrays by name. `ids` are the instances of a
/// product per instance.
///
/// # Errors
/// If an array has other lengths than its form or the other arrays, or a text is no JSON.
pub fn value(product: &str, key: &KeyId, arrays: &BTreeMap<String, NpyArray>, ids: &[InstanceId]) -> Result<Value> {
    let form = key.form();
    let is_per_instance = matches!(form, Form::PerInstance(_));
    let of_instances = |values: Vec<Value>| Value::PerInstance(ids.iter().copied().zip(values).collect());
    if *form.of_one() == Form::Text {
        let shape: &[usize] = if is_per_instance { &[ids.len()] } else { &[] };
        return match arrays.get(product) {
            Some(NpyArray::Texts(texts, lengths)) if lengths == shape => {
                let mut texts = texts.iter().map(|text| Value::from(text.as_str()));
                Ok(if is_per_instance { of_instances(texts.collect()) } else { texts.next().unwrap_or(Value::Null) })
            }
            _ => Err(Error::new(format!("its array `{product}` is not a {form}"))),
        };
    }
    let json_name = format!("{product}{JSON_END}");
    let json = arrays.get(&json_name);
    let is_json = *form.of_one() == Form::List && json.is_some();
    if is_json || is_per_instance && *form.of_one() == Form::Records {
        let array = json.ok_or_else(|| Error::new(format!("the archive has no array `{json_name}`")))?;
        let lists = rows(array, !is_per_instance, true);
        let lists = lists.map_err(|error| error.context(format!("array `{json_name}`")))?;
        if !is_per_instance {
            return Ok(lists.into_iter().flatten().next().unwrap_or(Value::Null));
        }
        if lists.len() != ids.len() {
            return Err(Error::new(format!("its array `{json_name}` has {} values, not {}", lists.len(), ids.len())));
        }
        return Ok(of_instances(lists.into_iter().map(|list| list.unwrap_or(Value::Null)).collect()));
    }
    let is_one = form == Form::Record;
    let mut count = if is_one { Some(1) } else { is_per_instance.then_some(ids.len()) };
    let mut records: Vec<Vec<(String, Value)>> = vec![Vec::new(); count.unwrap_or_default()];
    for (name, array) in arrays {
        let field = name.strip_prefix(product).and_then(|rest| rest.strip_prefix('_'));
        let field = field.ok_or_else(|| Error::new(format!("its array `{name}` is not a field of a {form}")))?;
        let (field, is_json) = field.strip_suffix(JSON_END).map_or((field, false), |field| (field, true));
        let rows = rows(array, is_one, is_json).map_err(|error| error.context(format!("array `{name}`")))?;
        let expected = *count.get_or_insert(rows.len());
        if rows.len() != expected {
            return Err(Error::new(format!("its array `{name}` has {} values, not {expected}", rows.len())));
        }
        records.resize(expected, Vec::new());
        for (record, value) in records.iter_mut().zip(rows) {
            record.extend(value.map(|value| (field.to_owned(), value)));
        }
    }
    let mut records = records.into_iter().map(Value::Record);
    Ok(match is_one {
        true => records.next().unwrap_or(Value::Null),
        false if is_per_instance => of_instances(records.collect()),
        false => Value::List(records.collect()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::product::standard::{CAMERA, KEYPOINTS, LIGHTS, OBJECT_INFO, OBJECT_NAME};

    /// Name, type and shape of an array.
    type Told = (String, String, Vec<usize>);

    fn of(key: KeyId, value: &Value) -> (BTreeMap<String, NpyArray>, Vec<Told>) {
        let NamedArrays { arrays, .. } = arrays(key.product, &key, value, [2, 3]).expect("arrays");
        let told = arrays.iter().map(|(name, array)| (name.clone(), array.descr.to_string(), array.shape.clone()));
        let told = told.collect();
        let read = |(name, array): (String, Array)| {
            let content = crate::decode::FileContent::new(array.encode(), "a.npy".into());
            (name, content.npy_array().expect("readable"))
        };
        (arrays.into_iter().map(read).collect(), told)
    }

    fn shape(name: &str, descr: &str, shape: &[usize]) -> Told {
        (name.to_owned(), descr.to_owned(), shape.to_vec())
    }

    #[test]
    fn records_are_an_array_per_field() {
        let camera = Value::record([
            ("width", 640_u32.into()),
            ("K", [[1.5, 0.0, 2.0], [0.0, 1.5, 1.0], [0.0, 0.0, 1.0]].into()),
            ("unit", "m".into()),
            ("lens", Value::record([("radius", 0.5.into())])),
        ]);
        let (arrays, told) = of(CAMERA.id(), &camera);
        let want = [
            shape("camera_width", "<i8", &[]),
            shape("camera_K", "<f8", &[3, 3]),
            shape("camera_unit", "<U1", &[]),
            // {"radius":0.5}
            shape("camera_lens_json", "<U14", &[]),
        ];
        assert_eq!(told, want);
        assert!(told.iter().all(|(name, ..)| product_of(name, &KnownProducts::default()) == "camera"));
        let json = |value: &Value| serde_json::to_value(value).expect("JSON");
        let read = value("camera", &CAMERA.id(), &arrays, &[]).expect("reads");
        assert_eq!(json(&read), json(&camera));
    }

    /// Fields that some records lack are NaN or empty there.
    #[test]
    fn records_of_a_list_share_their_arrays() {
        let lights = Value::List(vec![
            Value::record([("shape", "sphere".into()), ("center", [1.5, 2.0, 3.0].into()), ("map", "größe".into())]),
            Value::record([("shape", "window".into()), ("panes", [2_u32, 3].into()), ("more", [1.0, 2.0].into())]),
            Value::record([("shape", "disk".into()), ("center", [4.0, 5.5, 6.0].into()), ("more", [1.0].into())]),
        ]);
        let (arrays, told) = of(LIGHTS.id(), &lights);
        let want = [
            shape("lights_shape", "<U6", &[3]),
            shape("lights_center", "<f8", &[3, 3]),
            shape("lights_map", "<U5", &[3]),
            shape("lights_panes", "<f8", &[3, 2]),
            // Lists of different lengths: [1.0,2.0].
            shape("lights_more_json", "<U9", &[3]),
        ];
        assert_eq!(told, want);
        let NpyArray::Numbers(center) = &arrays["lights_center"] else { panic!("numbers") };
        assert!(matches!(center.element(3), Value::Float(missing) if missing.is_nan()));
        let json = |value: &Value| serde_json::to_value(value).expect("JSON");
        assert_eq!(json(&value("lights", &LIGHTS.id(), &arrays, &[]).expect("reads")), json(&lights));
        assert!(of(LIGHTS.id(), &Value::List(Vec::new())).0.is_empty());
    }

    #[test]
    fn values_of_instances_need_their_ids() {
        let ids = [InstanceId(2), InstanceId(7)];
        let info = |mass: f64| Value::record([("mass_kg", mass.into())]);
        let infos = Value::PerInstance(ids.into_iter().zip([info(0.5), info(2.0)]).collect());
        let (arrays, _) = of(OBJECT_INFO.id(), &infos);
        assert_eq!(value("object_info", &OBJECT_INFO.id(), &arrays, &ids).expect("reads"), infos);
        let error = value("object_info", &OBJECT_INFO.id(), &arrays, &ids[..1]).expect_err("refused").to_string();
        assert_eq!(error, "its array `object_info_mass_kg` has 2 values, not 1");
        let points =
            |names: &[&str]| Value::List(names.iter().map(|name| Value::record([("name", (*name).into())])).collect());
        let points = Value::PerInstance(ids.into_iter().zip([points(&["rim", "base"]), points(&[])]).collect());
        let (arrays, told) = of(KEYPOINTS.id(), &points);
        // [{"name":"rim"},{"name":"base"}]
        assert_eq!(told, [shape("keypoints_json", "<U32", &[2])]);
        assert_eq!(product_of("keypoints_json", &KnownProducts::default()), "keypoints");
        assert_eq!(value("keypoints", &KEYPOINTS.id(), &arrays, &ids).expect("reads"), points);
        let names = Value::PerInstance(ids.into_iter().zip(["mug".into(), "".into()]).collect());
        let (arrays, told) = of(OBJECT_NAME.id(), &names);
        assert_eq!(told, [shape("object_name", "<U3", &[2])]);
        assert_eq!(value("object_name", &OBJECT_NAME.id(), &arrays, &ids).expect("reads"), names);
        assert!(value("object_name", &OBJECT_NAME.id(), &arrays, &ids[..1]).is_err());
    }
}
