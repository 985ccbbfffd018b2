//! Products and files from answers.

use crate::message::{ERROR, NUMBER, RECORD, RESERVED, WARNINGS};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::path::Path;
use syntable_formats::decode::NpyArray;
use syntable_formats::npz_archive::{IDS, NpzArchive};
use syntable_formats::{record_arrays, samples};
use syntable_model::prelude::*;
use syntable_model::product::{DType, Form, Stored, Tensor};

/// The answer to a message.
pub struct Answer {
    archive: NpzArchive<Cursor<Vec<u8>>>,
    /// Names of the arrays that are products or files.
    names: BTreeSet<String>,
    record: Option<String>,
}

impl Answer {
    /// Opens the answer of a program to the message of a number.
    ///
    /// # Errors
    /// If it is no archive of arrays, answers another message, or has an error.
    pub fn new(bytes: Vec<u8>, number: u64, program: &Path, log: &dyn Log) -> Result<Self> {
        let place = format!("the answer of {}", program.display());
        let archive = NpzArchive::of_bytes(bytes, Path::new(&place))?;
        let names = archive.names();
        let mut answer = Self { archive, names: BTreeSet::new(), record: None };
        if let Some(other) = answer.archive.others().first() {
            let help = "the name of every member ends with .npy; the rest of the name is the array's";
            return Err(answer.refuse(format!("the archive has a member `{other}`, which is no array")).help(help));
        }
        if !answer.archive.is_stored()? {
            return Err(answer.refuse("the archive is compressed").help("write it with `np.savez` or `zip -0`"));
        }
        answer.check_number(number, names.contains(NUMBER))?;
        // With an error, warnings are shown, too.
        for name in names.into_iter().rev() {
            match name.as_str() {
                NUMBER => {}
                ERROR => return Err(Error::new(answer.texts(ERROR)?.join("\n")).in_file(program)),
                WARNINGS => {
                    answer.texts(WARNINGS)?.iter().for_each(|text| log.warn(&Error::new(text).in_file(program)))
                }
                RECORD => answer.record = Some(answer.texts(RECORD)?.join("\n")),
                reserved if reserved.starts_with(RESERVED) => {
                    let known = format!("an answer may have {ERROR}, {WARNINGS} and, of a writer, {RECORD}");
                    return Err(answer.refuse(format!("the array `{reserved}` means nothing")).help(known));
                }
                _ => drop(answer.names.insert(name)),
            }
        }
        Ok(answer)
    }

    /// Refuses the answer to another message: a program that answers twice would shift all later answers.
    fn check_number(&mut self, number: u64, has_number: bool) -> Result<()> {
        let help = "an answer repeats the array `syntable_number` of its message, and a message has one answer";
        if !has_number {
            return Err(self.refuse(format!("the answer has no array `{NUMBER}`")).help(help));
        }
        let found = match self.archive.array(NUMBER)?.npy_array()? {
            NpyArray::Numbers(tensor) if tensor.shape.iter().product::<usize>() == 1 => tensor.element(0),
            _ => Value::Null,
        };
        let is_same = match found {
            Value::Uint(found) => found == number,
            Value::Int(found) => u64::try_from(found) == Ok(number),
            _ => false,
        };
        let message = || self.refuse(format!("it answers another message: `{NUMBER}` is not {number}")).help(help);
        if is_same { Ok(()) } else { Err(message()) }
    }

    fn refuse(&self, what: impl Into<String>) -> Error {
        Error::new(what).in_file(self.archive.path())
    }

    /// The text of an array, or its texts.
    fn texts(&mut self, name: &str) -> Result<Vec<String>> {
        match self.archive.array(name)?.npy_array()? {
            NpyArray::Texts(texts, _) => Ok(texts),
            NpyArray::Numbers(_) => Err(self.refuse(format!("the array `{name}` is no text"))),
        }
    }

    /// The text that the program keeps for the end.
    pub fn take_record(&mut self) -> Option<String> {
        self.record.take()
    }

    /// Refuses arrays.
    pub fn check_empty(&self, message: &str) -> Result<()> {
        match self.names.first() {
            None => Ok(()),
            Some(name) => Err(self.refuse(format!("the answer to `{message}` must have no arrays, and has `{name}`"))),
        }
    }

    /// Puts the products of an image of this size. `ids` are the objects of the message.
    ///
    /// # Errors
    /// If a product is missing, has another type or another shape, or if an array belongs to none of them.
    pub fn put(
        mut self,
        provides: &[KeyId],
        ids: Option<Vec<InstanceId>>,
        size: [u32; 2],
        products: &mut Products,
    ) -> Result<()> {
        let known = ids;
        let own = self.archive.ids()?;
        if let (Some(own), Some(known)) = (&own, &known)
            && let Some(id) = own.iter().find(|id| !known.contains(id))
        {
            return Err(self.refuse(format!("`{IDS}` has {id}, which is no object of the view")));
        }
        let ids = own.or(known);
        for key in provides {
            let value = self.value(key, provides, ids.as_deref(), size);
            let value = value.map_err(|error| error.context(format!("product `{key}`")))?;
            let ids = ids.as_deref().unwrap_or_default();
            let put = products.put_stored(*key, Stored { value: &value, ids, missing: f64::NAN });
            put.map_err(|error| error.in_file(self.archive.path()))?;
        }
        match self.names.first() {
            None => Ok(()),
            Some(name) => {
                let all: Vec<String> = provides.iter().map(|key| format!("`{key}`")).collect();
                let error = self.refuse(format!("the array `{name}` belongs to no product"));
                Err(error.help(format!("`provides` names {}", all.join(", "))))
            }
        }
    }

    /// The value of a product, whose arrays are removed.
    fn value(&mut self, key: &KeyId, provides: &[KeyId], ids: Option<&[InstanceId]>, size: [u32; 2]) -> Result<Value> {
        let name = key.to_string();
        let form = key.form();
        let is_per_instance = matches!(form, Form::PerInstance(_));
        let objects: &[InstanceId] = match ids {
            Some(ids) => ids,
            None if is_per_instance => {
                let help = "read a product of objects, or add an array `ids` to the answer";
                return Err(self.refuse("it has values per object, and the ids of the objects are unknown").help(help));
            }
            None => &[],
        };
        if let Form::Record | Form::Records = form.of_one() {
            let is_of = |array: &str, name: &str| array.strip_prefix(name).is_some_and(|rest| rest.starts_with('_'));
            // `note_count` may be a field of `note`, or another product.
            let longer = provides.iter().map(KeyId::to_string).filter(|other| is_of(other, &name)).collect::<Vec<_>>();
            let is_others = |array: &str| longer.iter().any(|other| array == other || is_of(array, other));
            let of_record = |array: &String| is_of(array, &name) && !is_others(array);
            let names: Vec<String> = self.names.iter().filter(|array| of_record(array)).cloned().collect();
            if names.is_empty() && !(is_per_instance && objects.is_empty()) {
                return Err(self.refuse(format!("a {form} has an array `{name}_{{field}}` per field")));
            }
            let arrays = names.into_iter().map(|array| Ok((array.clone(), self.take(&array)?)));
            let arrays = arrays.collect::<Result<BTreeMap<_, _>>>()?;
            return record_arrays::value(&name, key, &arrays, objects)
                .map_err(|error| error.in_file(self.archive.path()));
        }
        let first = is_per_instance.then_some(objects.len());
        match form.of_one() {
            Form::Text | Form::List => {
                let is_list = *form.of_one() == Form::List;
                let texts = match self.take(&name)? {
                    NpyArray::Texts(texts, shape) if shape == first.into_iter().collect::<Vec<_>>() => texts,
                    array => return Err(self.unlike(&array, "text", first, Some(&[]))),
                };
                let value = |text: String| match is_list {
                    false => Ok(Value::Text(text)),
                    true => serde_json::from_str::<serde_json::Value>(&text)
                        .map_err(|error| self.refuse(format!("a list is text of JSON: {error}")))
                        .and_then(|json| Value::of(&json)),
                };
                let mut values = texts.into_iter().map(value).collect::<Result<Vec<_>>>()?;
                Ok(match is_per_instance {
                    true => Value::PerInstance(objects.iter().copied().zip(values).collect()),
                    false => values.pop().unwrap_or(Value::Null),
                })
            }
            one => {
                let [width, height] = size.map(|edge| edge as usize);
                let (dtype, shape): (&str, Option<Vec<usize>>) = match one {
                    Form::Mask => ("bool", Some(vec![height, width])),
                    Form::Image { dtype, channels } => {
                        (dtype.numpy(), Some([height, width].into_iter().chain(*channels).collect()))
                    }
                    Form::Tensor(dtype) => (dtype.numpy(), None),
                    Form::Bool => ("bool", Some(Vec::new())),
                    Form::Int => ("integers", Some(Vec::new())),
                    _ => ("numbers", Some(Vec::new())),
                };
                let array = self.take(&name)?;
                let is_whole = |tensor: &Tensor| {
                    shape.as_ref().is_none_or(|shape| first.iter().chain(shape).eq(&tensor.shape))
                        && has_type(one, tensor.dtype)
                };
                let tensor = match array {
                    NpyArray::Numbers(tensor) if is_whole(&tensor) => tensor,
                    array => return Err(self.unlike(&array, dtype, first, shape.as_deref())),
                };
                if is_per_instance {
                    let ids = objects.iter().flat_map(|id| id.0.to_le_bytes()).collect();
                    let ids = Tensor::new(DType::U16, &["instance"], vec![objects.len()], ids);
                    return samples::instances(&tensor, &ids).map_err(|reason| self.refuse(reason));
                }
                Ok(match tensor.shape.as_slice() {
                    [] if !matches!(one, Form::Tensor(_)) => tensor.element(0),
                    _ => Value::Tensor(tensor),
                })
            }
        }
    }

    /// An array, which is removed.
    fn take(&mut self, name: &str) -> Result<NpyArray> {
        if !self.names.remove(name) {
            let error = self.refuse(format!("the answer has no array `{name}`"));
            return Err(match self.names.is_empty() {
                true => error.help("`provides` of the recipe names it"),
                false => error.help(format!("it has {}", self.names.iter().cloned().collect::<Vec<_>>().join(", "))),
            });
        }
        self.archive.array(name)?.npy_array()
    }

    fn unlike(&self, array: &NpyArray, dtype: &str, first: Option<usize>, shape: Option<&[usize]>) -> Error {
        let (found, lengths) = type_of(array);
        let expected = match shape {
            Some(shape) => Shape(&first.into_iter().chain(shape.iter().copied()).collect::<Vec<_>>()).to_string(),
            None => "any length".to_owned(),
        };
        let objects = first.map_or(String::new(), |count| format!(", of {count} objects"));
        let found = format!("it is {found} of shape {}", Shape(lengths));
        self.refuse(format!("{found}; {dtype} of shape {expected} is expected{objects}"))
    }

    /// Files by their paths.
    ///
    /// # Errors
    /// If an array is not one axis of bytes.
    pub fn files(mut self) -> Result<Vec<(String, Vec<u8>)>> {
        if self.archive.ids()?.is_some() {
            return Err(self.refuse(format!("`{IDS}` is no path for a file")).help("name the file otherwise"));
        }
        let mut files = Vec::new();
        for name in std::mem::take(&mut self.names) {
            match self.archive.array(&name)?.npy_array()? {
                NpyArray::Numbers(tensor) if tensor.dtype == DType::U8 && tensor.shape.len() == 1 => {
                    files.push((name, tensor.bytes));
                }
                array => {
                    let (found, lengths) = type_of(&array);
                    let message =
                        format!("file `{name}` is {found} of shape {}, not one axis of uint8", Shape(lengths));
                    let help = "a file is an array of its bytes, such as `np.frombuffer(data, np.uint8)`";
                    return Err(self.refuse(message).help(help));
                }
            }
        }
        Ok(files)
    }
}

/// NumPy's name of the type of an array, and its lengths.
fn type_of(array: &NpyArray) -> (&'static str, &[usize]) {
    match array {
        NpyArray::Texts(_, shape) => ("text", shape),
        NpyArray::Numbers(tensor) => (tensor.dtype.numpy(), &tensor.shape),
    }
}

/// Whether an array of a type holds values of a form.
fn has_type(form: &Form, found: DType) -> bool {
    match form {
        Form::Image { dtype, .. } | Form::Tensor(dtype) => *dtype == found,
        Form::Mask | Form::Bool => found == DType::Bool,
        Form::Int => !found.is_float() && found != DType::Bool,
        _ => found != DType::Bool,
    }
}

/// A shape as NumPy prints it.
struct Shape<'a>(&'a [usize]);

impl std::fmt::Display for Shape<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.0 {
            [one] => write!(f, "({one},)"),
            lengths => write!(f, "({})", lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
        }
    }
}
